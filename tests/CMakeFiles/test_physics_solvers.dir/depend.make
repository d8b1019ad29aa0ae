# Empty dependencies file for test_physics_solvers.
# This may be replaced when dependencies are built.
