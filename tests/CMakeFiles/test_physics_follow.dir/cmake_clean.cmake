file(REMOVE_RECURSE
  "CMakeFiles/test_physics_follow.dir/physics/test_follow.c.o"
  "CMakeFiles/test_physics_follow.dir/physics/test_follow.c.o.d"
  "test_physics_follow"
  "test_physics_follow.pdb"
)

# Per-language clean rules from dependency scanning.
foreach(lang C)
  include(CMakeFiles/test_physics_follow.dir/cmake_clean_${lang}.cmake OPTIONAL)
endforeach()
