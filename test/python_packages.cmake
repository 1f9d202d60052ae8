# Debian's Python is the one that deploy/packages.txt gives its libraries to.
find_program(SELFCAL_PYTHON python3
  PATHS /usr/bin NO_DEFAULT_PATH REQUIRED)

# selfcal_python_packages(VARIABLE REQUIREMENTS TESTS)
# Sets VARIABLE to a folder with the packages of PyPI that the file REQUIREMENTS
# lists with their checksums; they are fetched when the build is configured, and
# again when that file changes. If pip cannot fetch them it is empty, and a
# warning says that TESTS are left out.
function(selfcal_python_packages variable requirements tests)
  set(file ${CMAKE_CURRENT_SOURCE_DIR}/${requirements})
  set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS ${file})
  file(SHA256 ${file} wanted)
  set(folder ${CMAKE_CURRENT_BINARY_DIR}/packages-${wanted})
  if(NOT EXISTS ${folder})
    message(STATUS "Python packages for ${tests}: fetching")
    execute_process(
      COMMAND ${SELFCAL_PYTHON} -m pip install --quiet --no-deps
        --require-hashes --only-binary :all: --root-user-action ignore
        --target ${folder}.new -r ${file}
      RESULT_VARIABLE failed
      ERROR_VARIABLE error)
    if(failed)
      string(STRIP "${error}" error)
      message(WARNING
        "left out: ${tests}: pip cannot fetch their packages: ${error}")
      set(${variable} "" PARENT_SCOPE)
      return()
    endif()
    file(RENAME ${folder}.new ${folder})
  endif()
  set(${variable} ${folder} PARENT_SCOPE)
endfunction()
