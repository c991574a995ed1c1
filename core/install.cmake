# liborbmorph for other programs: shared and static library, headers, orbmorph.pc and the CMake package. Component
# `library` is what a program needs to run, `development` what it takes to build one.
include(CMakePackageConfigHelpers)
include(CheckLinkerFlag)

# The shared library. `orbmorph` alone is the name of the command line's target.
add_library(orbmorph_shared SHARED $<TARGET_OBJECTS:orbmorph_objects>)
set_target_properties(orbmorph_shared PROPERTIES OUTPUT_NAME orbmorph EXPORT_NAME orbmorph
  VERSION ${PROJECT_VERSION} SOVERSION ${PROJECT_VERSION_MAJOR})
target_include_directories(orbmorph_shared INTERFACE $<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}>)
target_link_libraries(orbmorph_shared PRIVATE PkgConfig::QHULL PkgConfig::CJSON PkgConfig::ZLIB PkgConfig::EXPAT
  PkgConfig::PNG PkgConfig::JPEG ${ORB_MESHOPT} ${ORB_DRACO} Threads::Threads m)
if(CMAKE_SYSTEM_NAME STREQUAL "Linux" AND NOT ORB_SANITIZE)
  target_link_options(orbmorph_shared PRIVATE -Wl,-z,relro,-z,now)
endif()
# Names of the C++ library that the compiler defines in our objects are visible by default; the map hides them.
set(map ${CMAKE_CURRENT_SOURCE_DIR}/orbmorph.map)
check_linker_flag(C "-Wl,--version-script=${map}" ORB_HAS_VERSION_SCRIPT)
if(ORB_HAS_VERSION_SCRIPT)
  target_link_options(orbmorph_shared PRIVATE "-Wl,--version-script=${map}")
  set_target_properties(orbmorph_shared PROPERTIES LINK_DEPENDS ${map})
endif()

# The static library. All objects become one, in which hidden names turn local: they cannot clash with a program's own.
# Needs GNU ld and objcopy; elsewhere the archive holds the objects as they are.
set(ORB_LOCALIZE OFF)
if(CMAKE_LINKER AND CMAKE_OBJCOPY AND NOT ORB_SANITIZE)
  execute_process(COMMAND ${CMAKE_LINKER} --version OUTPUT_VARIABLE linker ERROR_QUIET)
  if(linker MATCHES "^GNU ld")
    set(ORB_LOCALIZE ON)
  endif()
endif()
if(ORB_LOCALIZE)
  set(object ${CMAKE_CURRENT_BINARY_DIR}/liborbmorph.o)
  add_custom_command(OUTPUT ${object}
    COMMAND ${CMAKE_LINKER} -r --force-group-allocation -o ${object}.all $<TARGET_OBJECTS:orbmorph_objects>
    COMMAND ${CMAKE_OBJCOPY} --localize-hidden --wildcard --localize-symbol=_Z* ${object}.all ${object}
    COMMAND ${CMAKE_COMMAND} -E rm ${object}.all
    DEPENDS orbmorph_objects $<TARGET_OBJECTS:orbmorph_objects> COMMAND_EXPAND_LISTS VERBATIM
    COMMENT "One object of all of core, with its inner names local")
  add_library(orbmorph_static STATIC ${object})
  set_source_files_properties(${object} PROPERTIES EXTERNAL_OBJECT ON GENERATED ON)
else()
  add_library(orbmorph_static STATIC $<TARGET_OBJECTS:orbmorph_objects>)
endif()
set_target_properties(orbmorph_static PROPERTIES OUTPUT_NAME orbmorph EXPORT_NAME static LINKER_LANGUAGE CXX)
target_compile_definitions(orbmorph_static INTERFACE ORB_STATIC)
target_include_directories(orbmorph_static INTERFACE $<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}>)
target_link_libraries(orbmorph_static INTERFACE qhull_r cjson png jpeg z expat meshoptimizer draco Threads::Threads m)

# orbmorph.pc finds its folders relative to itself: the files may be installed anywhere.
set(libraries ${CMAKE_INSTALL_FULL_LIBDIR})
file(RELATIVE_PATH ORB_PREFIX_FROM_PC ${libraries}/pkgconfig ${CMAKE_INSTALL_PREFIX})
string(REGEX REPLACE "/$" "" ORB_PREFIX_FROM_PC "${ORB_PREFIX_FROM_PC}")
file(RELATIVE_PATH ORB_LIBDIR ${CMAKE_INSTALL_PREFIX} ${libraries})
# A C program that links the static library needs the C++ library by name.
set(ORB_CXX_LIBRARY -lstdc++)
if(CMAKE_SYSTEM_NAME MATCHES "Darwin|FreeBSD")
  set(ORB_CXX_LIBRARY -lc++)
endif()
configure_file(orbmorph.pc.in orbmorph.pc @ONLY)

set(package ${CMAKE_INSTALL_LIBDIR}/cmake/orbmorph)
configure_package_config_file(orbmorph-config.cmake.in orbmorph-config.cmake INSTALL_DESTINATION ${package}
  NO_SET_AND_CHECK_MACRO)
write_basic_package_version_file(orbmorph-config-version.cmake COMPATIBILITY SameMajorVersion)

install(TARGETS orbmorph_shared EXPORT orbmorph
  LIBRARY DESTINATION ${CMAKE_INSTALL_LIBDIR} COMPONENT library NAMELINK_COMPONENT development)
install(TARGETS orbmorph_static EXPORT orbmorph
  ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR} COMPONENT development)
install(EXPORT orbmorph FILE orbmorph-targets.cmake NAMESPACE orbmorph:: DESTINATION ${package} COMPONENT development)
install(DIRECTORY include/orbmorph DESTINATION ${CMAKE_INSTALL_INCLUDEDIR} COMPONENT development)
install(FILES ${CMAKE_CURRENT_BINARY_DIR}/orbmorph.pc DESTINATION ${CMAKE_INSTALL_LIBDIR}/pkgconfig
  COMPONENT development)
install(FILES ${CMAKE_CURRENT_BINARY_DIR}/orbmorph-config.cmake
  ${CMAKE_CURRENT_BINARY_DIR}/orbmorph-config-version.cmake DESTINATION ${package} COMPONENT development)
