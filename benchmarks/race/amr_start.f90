! Start of AMRClaw on the race's interface: a shock at x = shock before a line x = a0 cos(2 pi y).
module race_start
    implicit none
    integer, parameter :: samples = 16
    real(kind=8) :: shock, a0, left(3), right(3), heavy(3)
end module race_start

subroutine setprob
    use race_start
    implicit none
    real(kind=8) :: gamma
    common /cparam/ gamma

    call opendatafile(7, 'setprob.data')
    read(7,*) gamma
    read(7,*) shock
    read(7,*) a0
    read(7,*) left
    read(7,*) right
    read(7,*) heavy
end subroutine setprob

subroutine qinit(meqn, mbc, mx, my, xlower, ylower, dx, dy, q, maux, aux)
    use race_start
    implicit none
    integer, intent(in) :: meqn, mbc, mx, my, maux
    real(kind=8), intent(in) :: xlower, ylower, dx, dy
    real(kind=8), intent(in) :: aux(maux, 1-mbc:mx+mbc, 1-mbc:my+mbc)
    real(kind=8), intent(inout) :: q(meqn, 1-mbc:mx+mbc, 1-mbc:my+mbc)
    real(kind=8) :: gamma, line, share, state(3), x
    integer :: i, j, n
    common /cparam/ gamma

    do j = 1, my
        do i = 1, mx
            x = xlower + i*dx
            share = 0.d0
            do n = 1, samples
                line = a0*cos(6.283185307179586d0*(ylower + (j - 1 + (n - 0.5d0)/samples)*dy))
                share = share + max(0.d0, min(1.d0, (x - line)/dx))/samples
            end do
            state = right + (heavy - right)*share
            if (x - 0.5d0*dx < shock) state = left
            q(1,i,j) = state(1)
            q(2,i,j) = state(1)*state(2)
            q(3,i,j) = 0.d0
            q(4,i,j) = state(3)/(gamma - 1.d0) + 0.5d0*state(1)*state(2)**2
        end do
    end do
end subroutine qinit
