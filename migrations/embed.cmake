# Writes OUTPUT, a C++ file that defines FUNCTION, which returns the name, text
# and SHA-256 of each file of MIGRATIONS, in their order. Run as a script:
# cmake -DOUTPUT= -DFUNCTION= -DMIGRATIONS= -P.
set(entries "")
foreach(path IN LISTS MIGRATIONS)
  get_filename_component(name ${path} NAME)
  file(READ ${path} sql)
  file(SHA256 ${path} checksum)
  if(sql MATCHES "\\)sql\"")
    message(FATAL_ERROR "${path} contains the end of a raw string, )sql\"")
  endif()
  string(APPEND entries
         "    {\"${name}\", \"${checksum}\", R\"sql(${sql})sql\"},\n")
endforeach()
file(WRITE ${OUTPUT} "#include \"migrations/migrations.h\"

namespace selfcal::server {
namespace {

constexpr Migration k${FUNCTION}[] = {
${entries}};

}  // namespace

std::span<const Migration> ${FUNCTION}() { return k${FUNCTION}; }

}  // namespace selfcal::server
")
