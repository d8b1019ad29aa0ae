# Empty compiler generated dependencies file for test_physics_oracle.
# This may be replaced when dependencies are built.
