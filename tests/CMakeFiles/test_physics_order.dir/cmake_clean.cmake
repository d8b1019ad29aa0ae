file(REMOVE_RECURSE
  "CMakeFiles/test_physics_order.dir/physics/test_order.c.o"
  "CMakeFiles/test_physics_order.dir/physics/test_order.c.o.d"
  "test_physics_order"
  "test_physics_order.pdb"
)

# Per-language clean rules from dependency scanning.
foreach(lang C)
  include(CMakeFiles/test_physics_order.dir/cmake_clean_${lang}.cmake OPTIONAL)
endforeach()
