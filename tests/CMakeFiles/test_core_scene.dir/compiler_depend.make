# Empty compiler generated dependencies file for test_core_scene.
# This may be replaced when dependencies are built.
