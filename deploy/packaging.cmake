# Debian packages, one for each component: selfcald (the daemon), selfcal (the
# command line), libselfcal0 and libselfcal-dev (the client library). What they
# depend on is read from what they link. deploy/package builds them.
include(GNUInstallDirs)

set(SELFCAL_MAINTAINER "The selfcal authors <selfcal@localhost>" CACHE STRING
    "Name and address that the packages carry")

set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_CONTACT ${SELFCAL_MAINTAINER})
set(CPACK_PACKAGE_VENDOR selfcal)
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_STRIP_FILES ON)
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_COMPONENTS_GROUPING IGNORE)
set(CPACK_COMPONENTS_ALL daemon cli library development)
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

# selfcal_package(COMPONENT PACKAGE SECTION SUMMARY): the summary is the first
# line of the description; the licence goes where Debian looks for it.
macro(selfcal_package component package section summary)
  string(TOUPPER ${component} upper)
  set(CPACK_DEBIAN_${upper}_PACKAGE_NAME ${package})
  set(CPACK_DEBIAN_${upper}_PACKAGE_SECTION ${section})
  set(CPACK_COMPONENT_${upper}_DESCRIPTION "${summary}")
  install(FILES ${PROJECT_SOURCE_DIR}/LICENSE
    DESTINATION ${CMAKE_INSTALL_DATADIR}/doc/${package}
    RENAME copyright
    COMPONENT ${component})
endmacro()

set(library libselfcal${PROJECT_VERSION_MAJOR})
selfcal_package(daemon selfcald science
  "daemon that keeps a camera-IMU calibration true")
set(deploy ${PROJECT_SOURCE_DIR}/deploy)
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
set(CPACK_DEBIAN_DAEMON_PACKAGE_DEPENDS "systemd, init-system-helpers")
set(CPACK_DEBIAN_DAEMON_PACKAGE_CONTROL_EXTRA
  ${deploy}/debian/conffiles
  ${deploy}/debian/postinst
  ${deploy}/debian/prerm
  ${deploy}/debian/postrm)
selfcal_package(cli selfcal science
  "command line of selfcald")
selfcal_package(library ${library} libs
  "client library of selfcald")
selfcal_package(development libselfcal-dev libdevel
  "client library of selfcald: headers, CMake package, contract, example")
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_DEPENDS
    "${library} (= ${PROJECT_VERSION}-1), libabsl-dev, libeigen3-dev")
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_SHLIBDEPS OFF)
set(CPACK_DEBIAN_DAEMON_PACKAGE_GENERATE_SHLIBS OFF)
set(CPACK_DEBIAN_CLI_PACKAGE_GENERATE_SHLIBS OFF)

# Manual pages and completion, written by the programs themselves: a target of
# its own, since installing builds nothing. Not by programs with sanitizers.
if(NOT SELFCAL_SANITIZE)
  find_program(SELFCAL_PYTHON python3
    PATHS /usr/bin NO_DEFAULT_PATH REQUIRED)
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
