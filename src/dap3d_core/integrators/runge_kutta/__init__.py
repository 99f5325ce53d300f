"""Explicit Runge-Kutta methods: DOP853, Dormand-Prince 5(4), RK4."""
