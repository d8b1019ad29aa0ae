# Empty compiler generated dependencies file for test_physics_follow.
# This may be replaced when dependencies are built.
