#include <support/broker_fixture.h>

#include <mapweave/core/files.h>
#include <mapweave/transport/certificates.h>

namespace mapweave::transport {
namespace {

using testing::HasSubstr;

TEST(Certificates, are_refused_for_hosts_that_are_none_and_by_no_authority) {
  const Certified authority = make_authority("tests", 2);
  EXPECT_THAT(authority.certificate, HasSubstr("BEGIN CERTIFICATE"));
  for (const char* host : {"", "two words", "a,DNS:b", "10.0.0.1/8"})
    EXPECT_EQ(error_of([&] { make_server_certificate(authority, {host}, 2); }).code(), ErrorCode::kBadInput) << host;
  const Certified other = make_authority("others", 2);
  EXPECT_EQ(error_of([&] {
              make_server_certificate({authority.certificate, other.key}, {"here"}, 2);
            }).code(),
            ErrorCode::kBadInput);
  EXPECT_EQ(error_of([&] { make_server_certificate({"none", "none"}, {"here"}, 2); }).code(), ErrorCode::kBadInput);
}

TEST(Certificates, passwords_differ) {
  EXPECT_EQ(random_password().size(), 32U);
  EXPECT_NE(random_password(), random_password());
}

using CertificatesTest = WithBroker;

TEST_F(CertificatesTest, let_clients_know_the_broker_by_its_authority_and_name) {
  const Certified authority = make_authority("tests", 2);
  auto guarded = options();
  const auto serve = [&](const std::vector<std::string>& hosts) {
    const Certified made = make_server_certificate(authority, hosts, 2);
    guarded.certificate = folder_.path() / "broker.pem";
    guarded.key = folder_.path() / "broker.key";
    write_file(guarded.certificate, made.certificate);
    write_file(guarded.key, made.key);
    return Broker(guarded);
  };
  NatsOptions client;
  client.ca_text = authority.certificate;
  {
    const Broker broker = serve({"broker.example", "127.0.0.1"});
    EXPECT_TRUE(connect(broker, client)->state().is_connected);
    client.url = broker.url();
    client.ca_text = make_authority("others", 2).certificate;
    const NatsConnection other(client);
    EXPECT_THROW(other.wait_until_connected(1s), Error) << "another authority's";
  }
  client.ca_text = authority.certificate;
  const Broker elsewhere = serve({"elsewhere.example"});
  client.url = elsewhere.url();
  const NatsConnection misled(client);
  EXPECT_THROW(misled.wait_until_connected(1s), Error) << "another machine's";
  client.ca_text = "no certificate";
  EXPECT_EQ(error_of([&] { NatsConnection never(client); }).code(), ErrorCode::kBadInput);
}

}  // namespace
}  // namespace mapweave::transport
