// solver_rk4: see solver_rk4.h
