# Empty dependencies file for knead_scene.
# This may be replaced when dependencies are built.
