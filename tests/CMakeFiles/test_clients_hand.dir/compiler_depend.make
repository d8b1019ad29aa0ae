# Empty compiler generated dependencies file for test_clients_hand.
# This may be replaced when dependencies are built.
