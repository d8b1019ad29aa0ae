# Empty compiler generated dependencies file for test_core_material.
# This may be replaced when dependencies are built.
