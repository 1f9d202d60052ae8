// Authorities and certificates for tests, made by the program openssl in a
// folder of their own.
#pragma once

#include <grpcpp/security/credentials.h>
#include <grpcpp/security/server_credentials.h>

#include <cstdlib>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include "test/support/files.h"
#include "test/support/temp_folder.h"

namespace selfcal {

class Certificates {
 public:
  // With the authority "ca" and the certificate "server" for 127.0.0.1.
  Certificates() {
    AddAuthority("ca");
    Add("server", "ca", "IP:127.0.0.1");
  }

  void AddAuthority(const std::string& name) {
    Run("openssl req -x509 " + NewKey(name) + " -out " + Pem(name) +
        " -days 2 -subj /CN=" + name);
  }

  // `names` as openssl writes alternative names, e.g. "URI:selfcal://...".
  void Add(const std::string& name,
           const std::string& authority,
           const std::string& names,
           int days = 2) {
    const std::string request = folder_.File(name + ".csr");
    Run("openssl req -new " + NewKey(name) + " -out " + request +
        " -subj /CN=" + name + " -addext 'subjectAltName=" + names + "'");
    Run("openssl x509 -req -in " + request + " -CA " + Pem(authority) +
        " -CAkey " + Key(authority) + " -copy_extensions copy -out " +
        Pem(name) + " -days " + std::to_string(days));
  }

  // Writes the key of a certificate to a file, under a passphrase.
  void Encrypt(const std::string& name, const std::string& path) const {
    Run("openssl pkey -aes256 -passout pass:secret -in " + Key(name) +
        " -out " + path);
  }

  std::string Pem(const std::string& name) const {
    return folder_.File(name + ".pem");
  }
  std::string Key(const std::string& name) const {
    return folder_.File(name + ".key");
  }

  // The settings of a daemon that listens with the certificate "server".
  std::vector<std::string> DaemonArguments() const {
    return {"--listen",
            "127.0.0.1:0",
            "--tls-certificate",
            Pem("server"),
            "--tls-key",
            Key("server"),
            "--tls-client-ca",
            Pem("ca")};
  }

  // A client that trusts `root` and shows the certificate `name`; none if it
  // is empty.
  std::shared_ptr<grpc::ChannelCredentials> Client(
      const std::string& name, const std::string& root = "ca") const {
    grpc::SslCredentialsOptions options;
    options.pem_root_certs = ReadBytes(Pem(root));
    if (!name.empty()) {
      options.pem_private_key = ReadBytes(Key(name));
      options.pem_cert_chain = ReadBytes(Pem(name));
    }
    return grpc::SslCredentials(options);
  }

  // The server "server", which demands a certificate of the authority "ca".
  std::shared_ptr<grpc::ServerCredentials> Server() const {
    grpc::SslServerCredentialsOptions options(
        GRPC_SSL_REQUEST_AND_REQUIRE_CLIENT_CERTIFICATE_AND_VERIFY);
    options.pem_root_certs = ReadBytes(Pem("ca"));
    options.pem_key_cert_pairs.push_back(
        {ReadBytes(Key("server")), ReadBytes(Pem("server"))});
    return grpc::SslServerCredentials(options);
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

  TempFolder folder_;
};

}  // namespace selfcal
