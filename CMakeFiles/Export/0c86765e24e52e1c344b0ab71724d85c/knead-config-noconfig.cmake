#----------------------------------------------------------------
# Generated CMake target import file.
#----------------------------------------------------------------

# Commands may need to know the format version.
set(CMAKE_IMPORT_FILE_VERSION 1)

# Import target "knead::knead" for configuration ""
set_property(TARGET knead::knead APPEND PROPERTY IMPORTED_CONFIGURATIONS NOCONFIG)
set_target_properties(knead::knead PROPERTIES
  IMPORTED_LINK_INTERFACE_LANGUAGES_NOCONFIG "C"
  IMPORTED_LOCATION_NOCONFIG "${_IMPORT_PREFIX}/lib/libknead.a"
  )

list(APPEND _cmake_import_check_targets knead::knead )
list(APPEND _cmake_import_check_files_for_knead::knead "${_IMPORT_PREFIX}/lib/libknead.a" )

# Commands beyond this point should not need to know the version.
set(CMAKE_IMPORT_FILE_VERSION)
