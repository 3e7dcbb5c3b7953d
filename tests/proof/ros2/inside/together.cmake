# Included by project() of a message package: what its generators wrote is compiled in groups, in a third of the time.
# Not together: descriptions, which all have a static of the same name; and introspection for C++, where a function is
# used before the next file specialises it.
set(CMAKE_UNITY_BUILD ON)
set(CMAKE_UNITY_BUILD_BATCH_SIZE 24)

function(captain_apart)
  get_target_property(sources ${PROJECT_NAME}__rosidl_generator_c SOURCES)
  list(FILTER sources INCLUDE REGEX "__description[.]c$")
  set_source_files_properties(${sources} PROPERTIES SKIP_UNITY_BUILD_INCLUSION ON)
  set_target_properties(${PROJECT_NAME}__rosidl_typesupport_introspection_cpp PROPERTIES UNITY_BUILD OFF)
  target_precompile_headers(${PROJECT_NAME}__rosidl_typesupport_introspection_cpp PRIVATE
    <array> <string> <vector> <rosidl_typesupport_introspection_cpp/message_introspection.hpp>)
endfunction()
cmake_language(DEFER CALL captain_apart)
include("${CMAKE_CURRENT_LIST_DIR}/folders.cmake")
