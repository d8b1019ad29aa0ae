file(REMOVE_RECURSE
  "CMakeFiles/tool_logcheck.dir/e2e/tool_logcheck.c.o"
  "CMakeFiles/tool_logcheck.dir/e2e/tool_logcheck.c.o.d"
  "tools/logcheck"
  "tools/logcheck.pdb"
)

# Per-language clean rules from dependency scanning.
foreach(lang C)
  include(CMakeFiles/tool_logcheck.dir/cmake_clean_${lang}.cmake OPTIONAL)
endforeach()
