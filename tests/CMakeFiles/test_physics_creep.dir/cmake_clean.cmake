file(REMOVE_RECURSE
  "CMakeFiles/test_physics_creep.dir/physics/test_creep.c.o"
  "CMakeFiles/test_physics_creep.dir/physics/test_creep.c.o.d"
  "test_physics_creep"
  "test_physics_creep.pdb"
)

# Per-language clean rules from dependency scanning.
foreach(lang C)
  include(CMakeFiles/test_physics_creep.dir/cmake_clean_${lang}.cmake OPTIONAL)
endforeach()
