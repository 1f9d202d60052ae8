#include "test/server/store/postgres/postgres_cluster.h"

#include <fcntl.h>
#include <grp.h>
#include <libpq-fe.h>
#include <pwd.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <stdexcept>
#include <utility>

#include "server/store/driver/driver.h"
#include "server/store/postgres/postgres_connection.h"
#include "test/support/eventually.h"

namespace selfcal::server {
namespace {

namespace fs = std::filesystem;

constexpr char kUser[] = "postgres";

// The folder of the newest server that is installed; empty if there is none.
std::string Binaries() {
  std::error_code none;
  int newest = 0;
  for (const auto& version :
       fs::directory_iterator("/usr/lib/postgresql", none)) {
    const int number = std::atoi(version.path().filename().c_str());
    if (fs::exists(version.path() / "bin/initdb") && number > newest) {
      newest = number;
    }
  }
  if (newest == 0) return "";
  return "/usr/lib/postgresql/" + std::to_string(newest) + "/bin/";
}

// The user that the server runs as; null for that of the process.
const passwd* ServerUser() {
  return geteuid() == 0 ? getpwnam(kUser) : nullptr;
}

}  // namespace

std::string PostgresCluster::WhyNot() {
  if (Binaries().empty()) return "PostgreSQL is not installed";
  if (geteuid() == 0 && ServerUser() == nullptr) {
    return "PostgreSQL does not run as root, and there is no user postgres";
  }
  // In a namespace of its own, root may be the only user.
  const TempFolder folder;
  if (const passwd* user = ServerUser();
      user != nullptr &&
      chown(folder.path().c_str(), user->pw_uid, user->pw_gid) != 0) {
    return "PostgreSQL does not run as root, and files cannot be given to the "
           "user postgres";
  }
  return "";
}

PostgresCluster::PostgresCluster(std::vector<std::string> settings)
    : settings_(std::move(settings)), owner_(getpid()) {
  const std::string why_not = WhyNot();
  if (!why_not.empty()) throw std::runtime_error(why_not);
  if (const passwd* user = ServerUser();
      user != nullptr &&
      chown(folder_.path().c_str(), user->pw_uid, user->pw_gid) != 0) {
    throw std::runtime_error("cannot give the folder to the server");
  }
  // The order of a language, which differs from that of bytes: the store must
  // not depend on it.
  const pid_t creation = Run({Binaries() + "initdb",
                              "--pgdata=" + folder_.File("data"),
                              std::string("--username=") + kUser,
                              "--auth=trust",
                              "--encoding=UTF8",
                              "--locale=C.UTF-8",
                              "--locale-provider=icu",
                              "--icu-locale=en-US",
                              "--no-sync",
                              "--no-instructions"});
  int status = 0;
  if (waitpid(creation, &status, 0) != creation || status != 0) {
    throw std::runtime_error("initdb failed: " + Log());
  }
  Start();
}

PostgresCluster::~PostgresCluster() {
  if (getpid() == owner_) Stop(SIGQUIT);
}

void PostgresCluster::Start() {
  std::vector<std::string> command = {Binaries() + "postgres",
                                      "-D",
                                      folder_.File("data"),
                                      "-k",
                                      folder_.path(),
                                      "-c",
                                      "listen_addresses="};
  for (const std::string& setting : settings_) {
    command.insert(command.end(), {"-c", setting});
  }
  server_ = Run(command);
  const std::string uri = Uri("template1");
  if (!Eventually([&] { return PQping(uri.c_str()) == PQPING_OK; })) {
    throw std::runtime_error("the server does not start: " + Log());
  }
}

void PostgresCluster::Stop(int signal) {
  if (server_ == 0) return;
  kill(server_, signal);
  waitpid(server_, nullptr, 0);
  server_ = 0;
}

std::string PostgresCluster::Uri(const std::string& database) const {
  // A folder as the host is that of the socket.
  std::string host;
  for (const char c : folder_.path().string()) {
    host += c == '/' ? "%2F" : std::string(1, c);
  }
  return std::string("postgresql://") + kUser + "@" + host + "/" + database;
}

bool PostgresCluster::Create(const std::string& database,
                             const std::string& original) const {
  const auto connection = PostgresConnection::Open(Uri("template1"));
  if (!connection.ok()) {
    throw std::runtime_error(connection.status().ToString());
  }
  const absl::Status created =
      (*connection)
          ->Execute("CREATE DATABASE " + database + " TEMPLATE " + original);
  if (created.ok()) return true;
  const std::string message(created.message());
  // The latter if it is being created.
  if (message.find("42P04") != std::string::npos ||
      message.find("23505") != std::string::npos) {
    return false;
  }
  throw std::runtime_error(message);
}

void PostgresCluster::Drop(const std::string& database) const {
  const auto connection = PostgresConnection::Open(Uri("template1"));
  if (!connection.ok()) return;
  (*connection)
      ->Execute("DROP DATABASE IF EXISTS " + database + " WITH (FORCE)")
      .IgnoreError();
}

pid_t PostgresCluster::Run(const std::vector<std::string>& command) const {
  std::vector<char*> arguments;
  for (const std::string& word : command) {
    arguments.push_back(const_cast<char*>(word.c_str()));
  }
  arguments.push_back(nullptr);
  const std::string log = folder_.File("log");
  const passwd* const user = ServerUser();
  const pid_t child = fork();
  if (child != 0) return child;
  if (user != nullptr &&
      (setgroups(0, nullptr) != 0 || setgid(user->pw_gid) != 0 ||
       setuid(user->pw_uid) != 0)) {
    _exit(126);
  }
  prctl(PR_SET_PDEATHSIG, SIGQUIT);
  const int output = open(log.c_str(), O_WRONLY | O_CREAT | O_APPEND, 0600);
  if (output < 0 || dup2(output, STDOUT_FILENO) < 0 ||
      dup2(output, STDERR_FILENO) < 0 || chdir("/") != 0) {
    _exit(126);
  }
  execv(arguments[0], arguments.data());
  _exit(127);
}

std::string PostgresCluster::Log() const {
  std::ifstream file(folder_.File("log"));
  return {std::istreambuf_iterator<char>(file), {}};
}

}  // namespace selfcal::server
