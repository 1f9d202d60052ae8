// A worker and nothing else.
#include "server/worker/worker.h"

int main() { return selfcal::server::RunWorker(); }
