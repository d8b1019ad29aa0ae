# Empty compiler generated dependencies file for test_physics_invariance.
# This may be replaced when dependencies are built.
