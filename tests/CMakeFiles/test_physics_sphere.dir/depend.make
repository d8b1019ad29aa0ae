# Empty dependencies file for test_physics_sphere.
# This may be replaced when dependencies are built.
