# find_package(selfcal) gives the targets selfcal::client (C++20; needs Eigen and
# Abseil) and selfcal::c (C and C++11; needs nothing). With COMPONENTS c, neither
# Eigen nor Abseil is looked for, and only selfcal::c can be linked.
include(CMakeFindDependencyMacro)
if(NOT selfcal_FIND_COMPONENTS)
  set(selfcal_FIND_COMPONENTS c client)
endif()
foreach(component ${selfcal_FIND_COMPONENTS})
  if(component STREQUAL "client")
    find_dependency(Eigen3 3.4)
    find_dependency(absl)
  elseif(NOT component STREQUAL "c")
    set(selfcal_FOUND FALSE)
    set(selfcal_NOT_FOUND_MESSAGE
        "there is no component ${component}, only c and client")
    return()
  endif()
endforeach()
include(${CMAKE_CURRENT_LIST_DIR}/selfcalTargets.cmake)
