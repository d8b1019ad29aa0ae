# Empty dependencies file for test_physics_creep.
# This may be replaced when dependencies are built.
