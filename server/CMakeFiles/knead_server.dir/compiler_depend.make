# Empty compiler generated dependencies file for knead_server.
# This may be replaced when dependencies are built.
