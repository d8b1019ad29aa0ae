# Empty compiler generated dependencies file for knead_viewer.
# This may be replaced when dependencies are built.
