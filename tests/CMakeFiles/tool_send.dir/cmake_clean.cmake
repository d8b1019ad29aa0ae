file(REMOVE_RECURSE
  "CMakeFiles/tool_send.dir/e2e/tool_send.c.o"
  "CMakeFiles/tool_send.dir/e2e/tool_send.c.o.d"
  "tools/send"
  "tools/send.pdb"
)

# Per-language clean rules from dependency scanning.
foreach(lang C)
  include(CMakeFiles/tool_send.dir/cmake_clean_${lang}.cmake OPTIONAL)
endforeach()
