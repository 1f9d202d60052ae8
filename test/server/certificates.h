// Authorities and certificates for tests, made by the program openssl in a
// folder of their own.
#pragma once

#include <grpcpp/security/credentials.h>
#include <stdlib.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <memory>
#include <stdexcept>
#include <string>

namespace selfcal::server {

class Certificates {
 public:
  // With the authority "ca" and the certificate "server" for 127.0.0.1.
  Certificates() {
    std::string folder = std::filesystem::temp_directory_path() / "scc-XXXXXX";
    folder_ = mkdtemp(folder.data());
    AddAuthority("ca");
    Add("server", "ca", "IP:127.0.0.1");
  }
  ~Certificates() { std::filesystem::remove_all(folder_); }
  Certificates(const Certificates&) = delete;
  Certificates& operator=(const Certificates&) = delete;

  void AddAuthority(const std::string& name) {
    Run("openssl req -x509 " + NewKey(name) + " -out " + Pem(name) +
        " -days 2 -subj /CN=" + name);
  }

  // `names` as openssl writes alternative names, e.g. "URI:selfcal://...".
  void Add(const std::string& name,
           const std::string& authority,
           const std::string& names,
           int days = 2) {
    const std::string request = folder_ / (name + ".csr");
    Run("openssl req -new " + NewKey(name) + " -out " + request +
        " -subj /CN=" + name + " -addext 'subjectAltName=" + names + "'");
    Run("openssl x509 -req -in " + request + " -CA " + Pem(authority) +
        " -CAkey " + Key(authority) + " -copy_extensions copy -out " +
        Pem(name) + " -days " + std::to_string(days));
  }

  std::string Pem(const std::string& name) const {
    return folder_ / (name + ".pem");
  }
  std::string Key(const std::string& name) const {
    return folder_ / (name + ".key");
  }

  static std::string Read(const std::string& path) {
    std::ifstream file(path);
    return {std::istreambuf_iterator<char>(file), {}};
  }

  // A client that trusts `root` and shows the certificate `name`; none if it
  // is empty.
  std::shared_ptr<grpc::ChannelCredentials> Client(
      const std::string& name, const std::string& root = "ca") const {
    grpc::SslCredentialsOptions options;
    options.pem_root_certs = Read(Pem(root));
    if (!name.empty()) {
      options.pem_private_key = Read(Key(name));
      options.pem_cert_chain = Read(Pem(name));
    }
    return grpc::SslCredentials(options);
  }

 private:
  std::string NewKey(const std::string& name) const {
    return "-newkey ec -pkeyopt ec_paramgen_curve:P-256 -nodes -keyout " +
           Key(name);
  }

  static void Run(const std::string& command) {
    if (std::system((command + " >/dev/null 2>&1").c_str()) != 0) {
      throw std::runtime_error("failed: " + command);
    }
  }

  std::filesystem::path folder_;
};

}  // namespace selfcal::server
