"""Riemann solvers: HLLC and HLL inside blocks, two-shock contact states on sides.

All are scalar parts of kernels.  Every formula is written so that exchanging the two states and
reversing the normal gives exactly the negative flux: a mirrored flow stays the mirror image
bitwise.  HLLC and HLL use speeds times the length of the face, which avoids the normalisation.
HLLC is divided into two parts, which a row of faces goes through one after the other: their long
chains of dependent operations then overlap between faces.
"""

from __future__ import annotations

from shockgrid.regrid.jit import compiled_once, inlined

# by the name of a flux: the pressure jump to a neighbour, over rho c², from which on all faces of a
# cell have the HLL flux, the others HLLC
HLL_JUMP_THRESHOLDS = {"hllc": 0.1, "hll": -1.0}
DEFAULT_FLUX = "hllc"
IDEAL_GAS_ERROR = 1e-9  # of the pressure, from rho c²/gamma
# difference of the pressures on both sides of a contact, over their sum, above which Newton's
# method has not settled; steps of bisection that go down to round-off
UNSETTLED_PRESSURES = 1e-9
# Newton's method for a contact: change of its speed, over the sound speed, at which it has settled
SETTLED_SPEED_CHANGE = 1e-14
MOST_NEWTON_STEPS = 20
LEAST_SLOPE_PART = 1e-3  # of rho c: slope of the pressure behind a release
LEAST_FALL_RATE = 1e-300  # of (rho c)² over the pressure: nothing is divided by 0
MOST_BISECTIONS = 60


@inlined
def reduce_jump(w_l, w_r, acoustic_weight):
    """Normal speeds of both sides of a face, of whose jump the part `acoustic_weight` is kept.

    rho c times this jump is in the pressure of every approximate solver.  In sound and in shocks it
    belongs there; in a slow flow without divergence it is a pressure of order Mach, where the
    true one is of order Mach², and wears the flow away [Thornber2008]; theory F3.12.
    """
    shift = 0.5 * (1.0 - acoustic_weight) * (w_r - w_l)
    return w_l + shift, w_r - shift


@inlined
def compute_normal_speeds(u_l, v_l, u_r, v_r, area_x, area_y, sweep):
    """Flow speeds of both sides normal to a moving face and relative to it, times its length."""
    return (u_l * area_x + v_l * area_y) - sweep, (u_r * area_x + v_r * area_y) - sweep


@inlined
def compute_waves(w_l, c2_l, w_r, c2_r, square):
    """Speeds (s_l, s_r) of the outer waves (theory F3.7), times the length of the face.

    `w`: of `compute_normal_speeds`; `c2`: squared sound speeds; `square`: the length's.
    """
    c_l = (c2_l * square) ** 0.5
    c_r = (c2_r * square) ** 0.5
    low_l = w_l - c_l
    low_r = w_r - c_r
    high_l = w_l + c_l
    high_r = w_r + c_r
    s_l = low_l if low_l < low_r else low_r
    s_r = high_r if high_r > high_l else high_l
    return s_l, s_r


@inlined
def compute_contact_speed(left, right, square):
    """Numerator and (negative) denominator of the speed s* of the contact, times the length.

    Also the mass flows rho (s - w) into both outer waves.  left, right: (rho, p, w, s), the speeds
    w of the flow and s of the outer wave times the length.
    """
    rho_l, p_l, w_l, s_l = left
    rho_r, p_r, w_r, s_r = right
    flow_l = rho_l * (s_l - w_l)
    flow_r = rho_r * (s_r - w_r)
    s_star_numerator = square * (p_r - p_l) + (flow_l * w_l - flow_r * w_r)
    return s_star_numerator, flow_l - flow_r, flow_l, flow_r


@inlined
def compute_star_flux(side, wave, face):
    """HLLC flux from the upwind side of the contact, and the pressure in it.

    side: (rho, u, v, p, e); wave: (w, flow, s, s_cut, s_star_numerator, s_star_denominator,
    square): speed and mass flow of this side, its outer wave, that wave's speed or 0 where it runs
    away from the face, the contact's speed s* as a fraction; face: (area_x, area_y, sweep).  All
    speeds times the length.
    """
    rho, u, v, p, e = side
    w, flow, s_side, s_cut, s_star_numerator, s_star_denominator, square = wave
    area_x, area_y, sweep = face
    s_star = s_star_numerator / s_star_denominator
    gap = s_side - s_star
    inverse = 1.0 / (gap * square)
    thinning = inverse * square
    rho_star = flow * thinning
    jump = (s_star - w) * (gap * inverse)
    p_star = p + flow * jump
    mass = rho * w + s_cut * (rho_star - rho)
    pressure = p + s_cut * rho_star * jump
    power = p * (w + sweep)
    work = power + s_cut * thinning * (p_star * (s_star + sweep) - power)
    return (
        mass,
        mass * u + pressure * area_x,
        mass * v + pressure * area_y,
        mass * (e + 0.5 * (u * u + v * v)) + work,
        pressure,
    )


@compiled_once(allocates=False)
def compute_hllc_flux(left, right, face, acoustic_weight):
    """HLLC flux of mass, momentum and energy through a moving face, times its length.

    [Toro1994] in the frame of the face, with the wave speeds of [Davis1988] (theory F3.8, F3.9).
    left, right: (rho, u, v, p, e, c²); face: normal times length, from left to right, and length
    times normal speed of the face (swept area per time); `acoustic_weight`: see `reduce_jump`.
    Returns (mass, momentum x, momentum y, energy) per time, and the pressure in it.
    """
    rho_l, u_l, v_l, p_l, e_l, c2_l = left
    rho_r, u_r, v_r, p_r, e_r, c2_r = right
    area_x, area_y, sweep = face
    square = area_x * area_x + area_y * area_y
    w_l, w_r = compute_normal_speeds(u_l, v_l, u_r, v_r, area_x, area_y, sweep)
    w_l, w_r = reduce_jump(w_l, w_r, acoustic_weight)
    s_l, s_r = compute_waves(w_l, c2_l, w_r, c2_r, square)
    s_star_numerator, s_star_denominator, flow_l, flow_r = compute_contact_speed(
        (rho_l, p_l, w_l, s_l), (rho_r, p_r, w_r, s_r), square
    )
    if s_star_numerator <= 0.0:
        s_cut = s_l if s_l < 0.0 else 0.0
        wave = w_l, flow_l, s_l, s_cut, s_star_numerator, s_star_denominator, square
        return compute_star_flux((rho_l, u_l, v_l, p_l, e_l), wave, face)
    s_cut = s_r if s_r > 0.0 else 0.0
    wave = w_r, flow_r, s_r, s_cut, s_star_numerator, s_star_denominator, square
    return compute_star_flux((rho_r, u_r, v_r, p_r, e_r), wave, face)


@inlined
def compute_hll_flux(left, right, face):
    """HLL flux (theory F3.10) through a moving face: arguments and result of `compute_hllc_flux`.

    It smears contacts and thereby damps the carbuncle of strong grid-aligned shocks.
    """
    rho_l, u_l, v_l, p_l, e_l, c2_l = left
    rho_r, u_r, v_r, p_r, e_r, c2_r = right
    area_x, area_y, sweep = face
    square = area_x * area_x + area_y * area_y
    # waves that leave the face, both or none towards one side
    w_l, w_r = compute_normal_speeds(u_l, v_l, u_r, v_r, area_x, area_y, sweep)
    s_l, s_r = compute_waves(w_l, c2_l, w_r, c2_r, square)
    s_l = s_l if s_l < 0.0 else 0.0
    s_r = s_r if s_r > 0.0 else 0.0
    # weights of the two sides and of the jump between them
    weight = 1.0 / (s_r - s_l)
    a = s_r * weight
    b = -s_l * weight
    d = s_l * a
    # conserved quantities on both sides and their flux
    total_l = e_l + 0.5 * (u_l * u_l + v_l * v_l)
    total_r = e_r + 0.5 * (u_r * u_r + v_r * v_r)
    mass_l = rho_l * w_l
    mass_r = rho_r * w_r
    return (
        (a * mass_l + b * mass_r) + d * (rho_r - rho_l),
        (a * (mass_l * u_l + p_l * area_x) + b * (mass_r * u_r + p_r * area_x))
        + d * (rho_r * u_r - rho_l * u_l),
        (a * (mass_l * v_l + p_l * area_y) + b * (mass_r * v_r + p_r * area_y))
        + d * (rho_r * v_r - rho_l * v_l),
        (
            a * (mass_l * total_l + p_l * (w_l + sweep))
            + b * (mass_r * total_r + p_r * (w_r + sweep))
        )
        + d * (rho_r * total_r - rho_l * total_l),
        (a * p_l + b * p_r) + d * (0.5 * (rho_l + rho_r)) * (w_r - w_l) / square,
    )


@inlined
def withhold(flux, side, leaving_fraction):
    """A flux of which only a part of the mass leaves the cell that it comes from.

    flux: (mass, momentum x, momentum y, energy, pressure); side: (u, v, e) there;
    leaving_fraction: of `hydro.eos.base.make_leaving_fraction`.  The pressure acts as it does.
    """
    mass, momentum_x, momentum_y, energy, pressure = flux
    u, v, e = side
    kept_mass = (1.0 - leaving_fraction) * mass
    return (
        mass - kept_mass,
        momentum_x - kept_mass * u,
        momentum_y - kept_mass * v,
        energy - kept_mass * (e + 0.5 * (u * u + v * v)),
        pressure,
    )


@compiled_once(allocates=False)
def compute_wave_pressure(rho, p, c, wave_law, du):
    """Pressure behind a wave that changes the normal velocity by `du`, and its slope in du.

    wave_law (a, b, z): see `EquationOfState.wave_law`.  For du > 0 a shock of the EOS's own shock
    speed.  For du < 0 an isentropic rarefaction.  With z = 0 it is that of the gas that has this
    sound speed and the same curvature for weak waves, gamma = 4 a - 1: exact for ideal and
    stiffened gases.  A condensed material breaks that law: released from a strong shock it
    is at p = 0 with nearly its first density, where that gas would still press.  Its (rho c)²
    falls with the pressure almost linearly (exactly, for a Mie-Grueneisen solid lighter than
    rho0) to z² at p = 0, and then p* = p + rho c du + k du²/4 with k the slope of (rho c)².
    The slope is kept above LEAST_SLOPE_PART rho c, so that Newton steps stay finite where material
    would break.  Theory F4.2, F4.3, F4.4.
    """
    slope_a, slope_b, z = wave_law
    impedance = rho * c
    if du > 0.0:
        # a shock, by the material's shock speed (F4.2)
        half_jump = slope_b * du
        root = (half_jump * half_jump + c * c) ** 0.5
        pressure = p + rho * (slope_a * du + root) * du
        slope = rho * (2.0 * slope_a * du + root + half_jump * half_jump / root)
    elif z > 0.0:
        # a release of condensed material: (rho c)² falls linearly with p (F4.4)
        fall_rate = impedance * impedance - z * z
        steepest_fall = 4.0 * slope_a * rho  # that of weak waves, as in the shock's law
        fall_rate = fall_rate / p if abs(fall_rate) < steepest_fall * abs(p) else steepest_fall
        fall_rate = fall_rate if fall_rate > LEAST_FALL_RATE else LEAST_FALL_RATE
        least_slope = LEAST_SLOPE_PART * impedance
        slope_floor_du = (least_slope - impedance) / (
            0.5 * fall_rate
        )  # where the slope has come down to the least
        linear_du = du if du > slope_floor_du else slope_floor_du
        slope = impedance + 0.5 * fall_rate * linear_du
        pressure = (
            p
            + (impedance + 0.25 * fall_rate * linear_du) * linear_du
            + least_slope * (du - linear_du)
        )
    else:
        # a release as that of a stiffened gas (F4.3)
        gamma = 4.0 * slope_a - 1.0
        sound_speed_ratio = 1.0 + 0.5 * (gamma - 1.0) * du / c
        sound_speed_ratio = sound_speed_ratio if sound_speed_ratio > 0.0 else 0.0
        power = sound_speed_ratio ** ((gamma + 1.0) / (gamma - 1.0))
        pressure = p + impedance * c / gamma * (power * sound_speed_ratio - 1.0)
        power = power if power > LEAST_SLOPE_PART else LEAST_SLOPE_PART
        slope = impedance * power
    return pressure, slope


@inlined
def compute_escape(c, wave_law):
    """How much faster than a gas its edge is that expands into a vacuum: 2 c / (gamma - 1)."""
    return c / (2.0 * wave_law[0] - 1.0)


@inlined
def is_ideal_gas(rho, p, c, wave_law):
    """Whether p = rho c²/gamma, so that its pressure in a vacuum is zero."""
    ideal_pressure = rho * c * c / (4.0 * wave_law[0] - 1.0)
    return wave_law[2] == 0.0 and abs(ideal_pressure - p) <= IDEAL_GAS_ERROR * p


@inlined
def compute_gas_pressure(rho, p, c, wave_law, du):
    """The pressure of `compute_wave_pressure` for an ideal gas, with all its digits where it is a
    tiny part of `p`."""
    if du >= 0.0:
        pressure, _ = compute_wave_pressure(rho, p, c, wave_law, du)
        return pressure
    gamma = 4.0 * wave_law[0] - 1.0
    sound_speed_ratio = 1.0 + 0.5 * (gamma - 1.0) * du / c
    return (
        p * sound_speed_ratio ** (2.0 * gamma / (gamma - 1.0)) if sound_speed_ratio > 0.0 else 0.0
    )


@compiled_once(allocates=False)
def bisect_contact(left, right):
    """(p*, w*) of `compute_contact` between two ideal gases, by bisection between the velocities
    of their edges in a vacuum.

    Near these a pressure depends on the velocity by a high power, so that Newton steps hardly move;
    the mean of two pressures that still differ would take energy out of the colder cell without
    end.  Gases that leave a vacuum between them have no pressure and the mean of both edges.
    """
    rho_l, w_l, p_l, c_l, law_l = left
    rho_r, w_r, p_r, c_r, law_r = right
    low = w_r - compute_escape(c_r, law_r)
    high = w_l + compute_escape(c_l, law_l)
    w_star = 0.5 * (low + high)
    if low >= high:
        return 0.0, w_star
    pressure_l = p_l
    pressure_r = p_r
    for _ in range(MOST_BISECTIONS):
        pressure_l = compute_gas_pressure(rho_l, p_l, c_l, law_l, w_l - w_star)
        pressure_r = compute_gas_pressure(rho_r, p_r, c_r, law_r, w_star - w_r)
        if pressure_l > pressure_r:
            low = w_star
        else:
            high = w_star
        if pressure_l == pressure_r:
            break
        w_star = 0.5 * (low + high)
    return min(pressure_l, pressure_r), w_star


@compiled_once(allocates=False)
def compute_contact(left, right, jump):
    """Mean pressure and normal velocity of the contact between two states, each behind one wave.

    left, right: (rho, w, p, c, law), w the velocity along the normal from left to right, `law` that
    of `EquationOfState.wave_law`; `jump`: pressure on the left less that on the right, from surface
    tension, of which half is to be added on the left and taken away on the right.  Newton steps
    from the acoustic solution, two or three in a smooth flow; returns (p*, w*).  Theory F4.1.
    """
    rho_l, w_l, p_l, c_l, law_l = left
    rho_r, w_r, p_r, c_r, law_r = right
    impedance_l = rho_l * c_l
    impedance_r = rho_r * c_r
    momentum = impedance_l * w_l + impedance_r * w_r
    w_star = (momentum + ((p_l - p_r) - jump)) / (impedance_l + impedance_r)
    small = SETTLED_SPEED_CHANGE * (c_l + c_r)
    pressure_l = p_l
    pressure_r = p_r
    for _ in range(MOST_NEWTON_STEPS):
        pressure_l, slope_l = compute_wave_pressure(rho_l, p_l, c_l, law_l, w_l - w_star)
        pressure_r, slope_r = compute_wave_pressure(rho_r, p_r, c_r, law_r, w_star - w_r)
        change = ((pressure_l - pressure_r) - jump) / (slope_l + slope_r)
        w_star = w_star + change
        if abs(change) <= small:
            break
    unsettled = jump == 0.0 and abs(pressure_l - pressure_r) > UNSETTLED_PRESSURES * (
        pressure_l + pressure_r
    )
    if unsettled and is_ideal_gas(rho_l, p_l, c_l, law_l) and is_ideal_gas(rho_r, p_r, c_r, law_r):
        return bisect_contact((rho_l, w_l, p_l, c_l, law_l), (rho_r, w_r, p_r, c_r, law_r))
    return 0.5 * (pressure_l + pressure_r), w_star


@compiled_once(allocates=False)
def compute_speed_at_pressure(rho, w, p, c, wave_law, p_star):
    """Normal velocity of a surface with given pressure `p_star` (free surface, pressure piston).

    `w`: velocity along the outward normal.  Newton steps from the acoustic solution.
    """
    w_star = w + (p - p_star) / (rho * c)
    for _ in range(MOST_NEWTON_STEPS):
        pressure, slope = compute_wave_pressure(rho, p, c, wave_law, w - w_star)
        change = (pressure - p_star) / slope
        w_star = w_star + change
        if abs(change) <= SETTLED_SPEED_CHANGE * c:
            break
    return w_star
