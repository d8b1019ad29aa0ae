file(REMOVE_RECURSE
  "CMakeFiles/test_core_safety.dir/core/test_safety.c.o"
  "CMakeFiles/test_core_safety.dir/core/test_safety.c.o.d"
  "test_core_safety"
  "test_core_safety.pdb"
)

# Per-language clean rules from dependency scanning.
foreach(lang C)
  include(CMakeFiles/test_core_safety.dir/cmake_clean_${lang}.cmake OPTIONAL)
endforeach()
