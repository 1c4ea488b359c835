#pragma once
// Certificates (X.509, ECDSA on P-256) and passwords for a deployment that makes its own.

#include <string>
#include <vector>

namespace mapweave::transport {

struct Certified {
  std::string certificate, key;  // PEM
};

// Who signs the certificates of brokers. Throws Error kInternal where OpenSSL fails, as the others.
Certified make_authority(const std::string& name, int days);
// Of a server that is reached by these names or IP addresses. Throws Error(kBadInput) for one that is neither, and for
// an authority that is none.
Certified make_server_certificate(const Certified& authority, const std::vector<std::string>& hosts, int days);
// 32 hexadecimal digits.
std::string random_password();

}  // namespace mapweave::transport
