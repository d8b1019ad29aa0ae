# Empty dependencies file for test_physics_stability.
# This may be replaced when dependencies are built.
