# Empty compiler generated dependencies file for test_physics_materials.
# This may be replaced when dependencies are built.
