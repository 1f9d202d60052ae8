# Builds the pages in web/ with npm, and embeds them. Sets SELFCAL_HAS_CONSOLE,
# and SELFCAL_CONSOLE_ASSETS: the source file with them.
#
# The packages of package-lock.json are fetched into the build directory when the
# build is configured, and again when the lock file changes; without those that
# only test/lint needs. One of them, ts-proto, is a plugin of protoc and generates
# the types of the contract's messages.

set(web_source ${CMAKE_CURRENT_SOURCE_DIR}/web)
set(web ${CMAKE_CURRENT_BINARY_DIR}/web)
set(SELFCAL_HAS_CONSOLE FALSE)
set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS
  ${web_source}/package-lock.json)

# selfcal_no_console(REASON): continues without the console, or fails if it was
# requested.
macro(selfcal_no_console reason)
  if(SELFCAL_CONSOLE STREQUAL "AUTO")
    message(WARNING "no web console in this build: ${reason} "
                    "(-DSELFCAL_CONSOLE=OFF disables this warning)")
  else()
    message(FATAL_ERROR "the web console was requested, but ${reason}")
  endif()
endmacro()

if(SELFCAL_CONSOLE STREQUAL "OFF")
  message(STATUS "web console: off")
else()
  find_program(SELFCAL_NODE NAMES node nodejs)
  find_program(SELFCAL_NPM npm)
  mark_as_advanced(SELFCAL_NODE SELFCAL_NPM)
  file(SHA256 ${web_source}/package-lock.json lock)
  set(stamp ${web}/installed-${lock})
  if(NOT SELFCAL_NODE OR NOT SELFCAL_NPM)
    selfcal_no_console("node and npm are not installed (nodejs and npm)")
  elseif(EXISTS ${stamp})
    set(SELFCAL_HAS_CONSOLE TRUE)
  else()
    message(STATUS "web console: fetching packages of npm")
    file(MAKE_DIRECTORY ${web})
    configure_file(${web_source}/package.json ${web}/package.json COPYONLY)
    configure_file(
      ${web_source}/package-lock.json ${web}/package-lock.json COPYONLY)
    execute_process(
      COMMAND ${SELFCAL_NPM} ci --omit=dev --ignore-scripts --no-audit --no-fund
      WORKING_DIRECTORY ${web}
      RESULT_VARIABLE failed
      OUTPUT_QUIET
      ERROR_VARIABLE error)
    if(failed)
      string(STRIP "${error}" error)
      selfcal_no_console("npm cannot fetch its packages: ${error}")
    else()
      file(TOUCH ${stamp})
      set(SELFCAL_HAS_CONSOLE TRUE)
    endif()
  endif()
endif()

if(SELFCAL_HAS_CONSOLE)
  message(STATUS "web console: on")
  file(GLOB_RECURSE web_files CONFIGURE_DEPENDS ${web_source}/src/*)
  list(APPEND web_files ${web_source}/index.html ${web_source}/tsconfig.json
    ${web_source}/build.mjs ${web_source}/generate.mjs
    ${web_source}/package-lock.json)
  file(GLOB proto_files CONFIGURE_DEPENDS
    ${PROJECT_SOURCE_DIR}/proto/selfcal/v1/*.proto)
  set(built ${web}/dist/index.html ${web}/dist/assets/app.js
    ${web}/dist/assets/app.css)
  # The pages are built in a copy, beside the packages.
  add_custom_command(
    OUTPUT ${built}
    COMMAND ${CMAKE_COMMAND} -E rm -rf ${web}/src ${web}/generated ${web}/dist
    COMMAND ${CMAKE_COMMAND} -E copy_directory ${web_source} ${web}
    COMMAND ${SELFCAL_NODE} generate.mjs
      $<TARGET_FILE:protobuf::protoc> ${PROJECT_SOURCE_DIR}/proto
    COMMAND ${SELFCAL_NODE} node_modules/typescript/bin/tsc --noEmit
    COMMAND ${SELFCAL_NODE} build.mjs
    WORKING_DIRECTORY ${web}
    DEPENDS ${web_files} ${proto_files}
    COMMENT "Building the pages of the web console"
    VERBATIM)
  set(SELFCAL_CONSOLE_ASSETS ${CMAKE_CURRENT_BINARY_DIR}/assets.cc)
  set(SELFCAL_CONSOLE_DIST ${web}/dist)
  configure_file(assets.cc.in ${SELFCAL_CONSOLE_ASSETS} @ONLY)
  # Compiled as one with others, the object would not depend on the pages.
  set_source_files_properties(${SELFCAL_CONSOLE_ASSETS} PROPERTIES
    OBJECT_DEPENDS "${built}" SKIP_UNITY_BUILD_INCLUSION ON)
endif()
# Variables for the tests.
set(SELFCAL_HAS_CONSOLE ${SELFCAL_HAS_CONSOLE} CACHE INTERNAL "")
set(SELFCAL_CONSOLE_WEB ${web} CACHE INTERNAL "")
