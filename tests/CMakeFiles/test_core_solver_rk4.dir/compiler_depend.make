# Empty compiler generated dependencies file for test_core_solver_rk4.
# This may be replaced when dependencies are built.
