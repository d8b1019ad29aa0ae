# Empty compiler generated dependencies file for test_physics_order.
# This may be replaced when dependencies are built.
