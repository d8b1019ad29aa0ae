# Empty compiler generated dependencies file for test_clients_mesh.
# This may be replaced when dependencies are built.
