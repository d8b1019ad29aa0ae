file(REMOVE_RECURSE
  "CMakeFiles/test_core_state.dir/core/test_state.c.o"
  "CMakeFiles/test_core_state.dir/core/test_state.c.o.d"
  "test_core_state"
  "test_core_state.pdb"
)

# Per-language clean rules from dependency scanning.
foreach(lang C)
  include(CMakeFiles/test_core_state.dir/cmake_clean_${lang}.cmake OPTIONAL)
endforeach()
