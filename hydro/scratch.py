"""Rows of the flat scratch array in which the flow kernels work.

One array, rows at constant offsets: the vectoriser then needs no run-time check of overlap (it
silently gives up beyond 128 of them).  SPAN is a multiple of 8 and not a power of two.  In every
row of cells, entry k holds the cell k - 1 of the chunk: k = 0 and k = m + 1 are its neighbours.
Rows of nodes and faces along j are shifted likewise.
"""

from __future__ import annotations

SPAN = 136
CHUNK = SPAN - 8

_ROWS = """
x_low y_low x_low_new y_low_new x_high y_high x_high_new y_high_new x_next y_next
rho_below u_below v_below p_below rho u v p rho_above u_above v_above p_above
length_below length length_above length_j
mi_x mi_y mj_x mj_y volume c2 smear smear_below
rho_x rho_y u_x u_y v_x v_y p_x p_y
rho_half u_half v_half p_half
rho_face u_face v_face p_face
rho_up u_up v_up p_up rho_left u_left v_left p_left rho_right u_right v_right p_right
flux_i_mass flux_i_x flux_i_y flux_i_energy
flux_i_mass_low flux_i_x_low flux_i_y_low flux_i_energy_low
flux_j_mass flux_j_x flux_j_y flux_j_energy
mass_pending x_pending y_pending energy_pending
most_rate least_c2 first_order sum_mass sum_x sum_y sum_energy
""".split()

OFFSET = {name: SPAN * row for row, name in enumerate(_ROWS)}
SIZE = SPAN * len(_ROWS)
