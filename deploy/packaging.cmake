# Debian packages, one for each component: selfcald (the daemon), selfcal (the
# command line), libselfcal0 and libselfcal-dev (the client library),
# python3-selfcal. What they depend on is read from what they link.
# deploy/package builds them.
include(GNUInstallDirs)

set(SELFCAL_MAINTAINER "The selfcal authors <selfcal@localhost>" CACHE STRING
    "Name and address that the packages carry")
set(SELFCAL_HOMEPAGE "https://selfcal.example" CACHE STRING
    "Address of the project that the packages carry")
set(deploy ${PROJECT_SOURCE_DIR}/deploy)
find_program(SELFCAL_PYTHON python3
  PATHS /usr/bin NO_DEFAULT_PATH REQUIRED)

set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_CONTACT ${SELFCAL_MAINTAINER})
set(CPACK_PACKAGE_VENDOR selfcal)
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_STRIP_FILES ON)
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_COMPONENTS_GROUPING IGNORE)
set(CPACK_COMPONENTS_ALL daemon cli library development python)
set(CPACK_DEBIAN_PACKAGE_HOMEPAGE ${SELFCAL_HOMEPAGE})
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_RELEASE 1)
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_PACKAGE_GENERATE_SHLIBS ON)
if(CMAKE_CROSSCOMPILING)
  # dpkg-shlibdeps reads the packages of the root, as deploy/package tells it.
  set(CPACK_DEBIAN_PACKAGE_ARCHITECTURE ${SELFCAL_DEBIAN_ARCHITECTURE})
  set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS_PRIVATE_DIRS
      ${CMAKE_SYSROOT}/lib/${CMAKE_LIBRARY_ARCHITECTURE}
      ${CMAKE_SYSROOT}/usr/lib/${CMAKE_LIBRARY_ARCHITECTURE})
endif()

set(changelogs ${PROJECT_BINARY_DIR}/changelogs)
set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS
  ${PROJECT_SOURCE_DIR}/CHANGELOG.md ${deploy}/debian_changelog.py)

# selfcal_package(COMPONENT PACKAGE SECTION SUMMARY DESCRIPTION): licence and
# changelog go where Debian looks for them.
macro(selfcal_package component package section summary description)
  string(TOUPPER ${component} upper)
  set(CPACK_DEBIAN_${upper}_PACKAGE_NAME ${package})
  set(CPACK_DEBIAN_${upper}_PACKAGE_SECTION ${section})
  set(CPACK_COMPONENT_${upper}_DESCRIPTION "${summary}\n${description}")
  set(changelog ${changelogs}/${package}/changelog.Debian.gz)
  file(MAKE_DIRECTORY ${changelogs}/${package})
  execute_process(
    COMMAND ${SELFCAL_PYTHON} ${deploy}/debian_changelog.py
      ${PROJECT_SOURCE_DIR}/CHANGELOG.md ${package} ${PROJECT_VERSION}
      ${SELFCAL_MAINTAINER} ${changelog}
    COMMAND_ERROR_IS_FATAL ANY)
  install(FILES ${deploy}/debian/copyright ${changelog}
    DESTINATION ${CMAKE_INSTALL_DATADIR}/doc/${package}
    COMPONENT ${component})
endmacro()

set(library libselfcal${PROJECT_VERSION_MAJOR})
selfcal_package(daemon selfcald science
  "daemon that keeps a camera-IMU calibration true"
  "Receives motion segments from a SLAM process, keeps the most informative,
recalibrates on them and publishes each new version with its uncertainty. No
calibration targets and no lab are needed.")
install(FILES ${deploy}/systemd/selfcald.service
  DESTINATION lib/systemd/system COMPONENT daemon)
install(FILES ${deploy}/systemd/selfcal.sysusers.conf
  DESTINATION lib/sysusers.d RENAME selfcal.conf COMPONENT daemon)
install(FILES ${deploy}/systemd/selfcal.tmpfiles.conf
  DESTINATION lib/tmpfiles.d RENAME selfcal.conf COMPONENT daemon)
install(FILES ${deploy}/selfcald.toml
  DESTINATION /etc/selfcal
  PERMISSIONS OWNER_READ OWNER_WRITE GROUP_READ
  COMPONENT daemon)
install(FILES
    ${deploy}/monitoring/alerts.yml ${deploy}/monitoring/client_alerts.yml
    ${deploy}/monitoring/dashboard.json
    ${deploy}/monitoring/fleet_dashboard.json
  DESTINATION ${CMAKE_INSTALL_DATADIR}/selfcald/monitoring COMPONENT daemon)
# In a container systemd-standalone-sysusers and -tmpfiles are enough.
set(CPACK_DEBIAN_DAEMON_PACKAGE_DEPENDS
    "systemd | systemd-sysusers, systemd | systemd-tmpfiles, init-system-helpers (>= 1.60)")
set(CPACK_DEBIAN_DAEMON_PACKAGE_CONTROL_EXTRA
  ${deploy}/debian/conffiles
  ${deploy}/debian/postinst
  ${deploy}/debian/prerm
  ${deploy}/debian/postrm)
selfcal_package(cli selfcal science
  "command line of selfcald"
  "Creates rigs, imports recordings, shows segments, tables, runs and versions of
calibrations, writes them in the formats of other tools, and makes backups.
Calibrates from recordings of images and readings, for which it needs selfcald.")
set(CPACK_DEBIAN_CLI_PACKAGE_RECOMMENDS selfcald)
selfcal_package(library ${library} libs
  "client library of selfcald"
  "Streams motion segments from a SLAM process to the daemon without blocking it,
and receives calibrations.")
selfcal_package(development libselfcal-dev libdevel
  "client library of selfcald: headers, CMake package, contract, examples"
  "Headers for C99, C++11 and C++20, a CMake package, modules of pkg-config, the
gRPC contract, and examples.")
set(CPACK_DEBIAN_LIBRARY_PACKAGE_CONTROL_EXTRA ${deploy}/debian/triggers)
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_DEPENDS
    "${library} (= ${PROJECT_VERSION}-1), libabsl-dev, libeigen3-dev")
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_SHLIBDEPS OFF)

# The Python package, generated from the contract. What the contract imports of
# google.api is in no package of Debian 12.
selfcal_package(python python3-selfcal python
  "Python client of selfcald"
  "Typed messages and services of the gRPC contract, a client that reads lists
page by page, and functions that apply a calibration (with python3-numpy).")
set(CPACK_DEBIAN_PYTHON_PACKAGE_ARCHITECTURE all)
set(CPACK_DEBIAN_PYTHON_PACKAGE_SHLIBDEPS OFF)
set(CPACK_DEBIAN_PYTHON_PACKAGE_GENERATE_SHLIBS OFF)
set(CPACK_DEBIAN_PYTHON_PACKAGE_DEPENDS
    "python3 (>= 3.9), python3-grpcio, python3-protobuf")
set(CPACK_DEBIAN_PYTHON_PACKAGE_RECOMMENDS python3-numpy)
set(python ${PROJECT_BINARY_DIR}/python)
file(GLOB_RECURSE python_sources CONFIGURE_DEPENDS
  ${PROJECT_SOURCE_DIR}/client/python/selfcal/*.py
  ${PROJECT_SOURCE_DIR}/proto/*.proto)
add_custom_command(
  OUTPUT ${python}/generated
  COMMAND ${CMAKE_COMMAND} -E rm -rf ${python}
  COMMAND ${PROJECT_SOURCE_DIR}/client/python/generate ${python}
  COMMAND ${CMAKE_COMMAND} -E touch ${python}/generated
  DEPENDS ${python_sources} ${PROJECT_SOURCE_DIR}/client/python/generate
  VERBATIM)
add_custom_target(selfcal_python ALL DEPENDS ${python}/generated)
selfcal_install_needs(python selfcal_python ${python}/generated)
install(DIRECTORY ${python}/selfcal ${python}/google
  DESTINATION lib/python3/dist-packages
  COMPONENT python
  PATTERN __pycache__ EXCLUDE)
set(CPACK_DEBIAN_DAEMON_PACKAGE_GENERATE_SHLIBS OFF)
set(CPACK_DEBIAN_CLI_PACKAGE_GENERATE_SHLIBS OFF)

# Manual pages and completion, written by the programs themselves: a target of
# its own, since installing builds nothing. Not by programs with sanitizers.
if(NOT SELFCAL_SANITIZE)
  set(pages ${PROJECT_BINARY_DIR}/pages)
  file(MAKE_DIRECTORY ${pages})
  set(written)

  # selfcal_page(NAME SECTION TARGET COMPONENT)
  function(selfcal_page name section target component)
    set(page ${pages}/${name}.${section}.gz)
    add_custom_command(
      OUTPUT ${page}
      COMMAND ${SELFCAL_PYTHON} ${deploy}/manual_page.py ${name} ${section}
        ${PROJECT_VERSION} ${page}
        ${CMAKE_CROSSCOMPILING_EMULATOR} $<TARGET_FILE:${target}>
      DEPENDS ${target} ${deploy}/manual_page.py
      VERBATIM)
    selfcal_install_needs(${component} selfcal_pages ${page})
    install(FILES ${page}
      DESTINATION ${CMAKE_INSTALL_MANDIR}/man${section}
      COMPONENT ${component})
    set(written ${written} ${page} PARENT_SCOPE)
  endfunction()
  selfcal_page(selfcal 1 selfcal-cli cli)
  selfcal_page(selfcald 8 selfcald daemon)

  # selfcal_completion(SHELL FOLDER FILE): in the folder that the shell reads.
  function(selfcal_completion shell folder file)
    set(script ${pages}/${shell}/${file})
    file(MAKE_DIRECTORY ${pages}/${shell})
    add_custom_command(
      OUTPUT ${script}
      COMMAND selfcal-cli completion ${shell} > ${script}
      DEPENDS selfcal-cli
      VERBATIM)
    selfcal_install_needs(cli selfcal_pages ${script})
    install(FILES ${script}
      DESTINATION ${CMAKE_INSTALL_DATADIR}/${folder}
      COMPONENT cli)
    set(written ${written} ${script} PARENT_SCOPE)
  endfunction()
  selfcal_completion(bash bash-completion/completions selfcal)
  selfcal_completion(zsh zsh/vendor-completions _selfcal)
  selfcal_completion(fish fish/vendor_completions.d selfcal.fish)
  add_custom_target(selfcal_pages ALL DEPENDS ${written})
endif()

include(CPack)
