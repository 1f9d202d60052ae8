// Writes the content of the fixtures into a new database of the present schema;
// fixtures/make goes on from there.
#include <cstdio>

#include "test/server/store/fixture_content.h"
#include "test/server/store/sqlite/open_sqlite_store.h"

int main(int argc, char** argv) {
  using namespace selfcal::server;
  if (argc != 2) {
    std::fprintf(stderr, "usage: write_store_fixture NEW_DATABASE\n");
    return 2;
  }
  const auto store = OpenSqliteStore(argv[1]);
  return store.ok() && WriteFixture(store->get()) ? 0 : 1;
}
