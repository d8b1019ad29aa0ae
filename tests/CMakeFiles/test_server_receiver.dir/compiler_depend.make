# Empty compiler generated dependencies file for test_server_receiver.
# This may be replaced when dependencies are built.
