#include <gtest/gtest.h>
#include <mapweave/core/error.h>
#include <mapweave/core/files.h>
#include <mapweave/transport/link_model.h>
#include <support/temporary_folder.h>

namespace mapweave::transport {
namespace {

TEST(LinkModel, takes_the_delay_and_what_the_bytes_take) {
  LinkModel link(LinkState{1e6, 0.02, 0.0, 0.0}, 1);
  EXPECT_NEAR(link.send(1.0, 500000), 1.0 + 0.5 + 0.02, 1e-9);
  EXPECT_NEAR(link.send(1.1, 100000), 1.5 + 0.1 + 0.02, 1e-9) << "waits for the first";
  EXPECT_NEAR(link.send(5.0, 0), 5.02, 1e-9);
}

TEST(LinkModel, carries_everything_at_once_without_a_profile) {
  LinkModel link(LinkModelOptions{}, 1);
  EXPECT_EQ(link.send(3.0, 1 << 30), 3.0);
}

TEST(LinkModel, sends_again_what_is_lost_and_keeps_the_order) {
  LinkModel sure(LinkState{1e6, 0.02, 0.0, 0.0}, 1), lossy(LinkState{1e6, 0.02, 0.0, 0.2}, 1);
  const double without_s = sure.send(0.0, 2'000'000), with_s = lossy.send(0.0, 2'000'000);
  EXPECT_NEAR(with_s / without_s, 1.0 / 0.8, 0.05);
  double last_s = with_s;
  for (int i = 0; i < 200; ++i) {
    const double arrived_s = lossy.send(with_s + 0.001 * i, 10);
    EXPECT_GE(arrived_s, last_s);
    last_s = arrived_s;
  }
}

TEST(LinkModel, gives_the_same_times_for_the_same_seed) {
  const LinkState state{5e5, 0.02, 0.01, 0.05};
  LinkModel one(state, 7), same(state, 7), other(state, 8);
  bool differs = false;
  for (int i = 0; i < 50; ++i) {
    const double here_s = one.send(0.1 * i, 20000);
    EXPECT_EQ(here_s, same.send(0.1 * i, 20000));
    differs = differs || here_s != other.send(0.1 * i, 20000);
  }
  EXPECT_TRUE(differs);
}

TEST(LinkModel, follows_a_trace_that_begins_again) {
  test::TemporaryFolder folder;
  write_file(folder.path() / "wire.csv", "# outage in the second second\n0,1000000\n1,0\n2,500000,0.1\n3,1\n");
  LinkModelOptions options;
  options.trace = (folder.path() / "wire.csv").string();
  options.delay_s = 0.01;
  LinkModel link(options, 1);
  EXPECT_NEAR(link.send(0.0, 500000), 0.51, 1e-6);
  EXPECT_NEAR(link.send(0.9, 350000), 2.5 + 0.1, 1e-3) << "100 kB, a pause, 250 kB";
  EXPECT_NEAR(link.send(3.0, 500000), 3.51, 1e-6) << "as at 0";
}

TEST(LinkModel, says_which_line_of_a_trace_is_wrong) {
  test::TemporaryFolder folder;
  for (const char* text : {"0,1000\n0.5,many\n", "0,1000\n-1,5\n", "0,1000\n0,5\n", "0\n0,1\n", "0,1000\n1,2,3,4,5,6\n",
                           "0,10\n1,10,0,0,0.95\n", "1,1000\n", "0,nan\n", "0,0\n1,0\n", "", "0,1e999\n"}) {
    write_file(folder.path() / "wire.csv", text);
    try {
      read_link_trace(folder.path() / "wire.csv", {});
      ADD_FAILURE() << text;
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ErrorCode::kBadInput) << text;
      EXPECT_NE(std::string(error.what()).find("wire.csv"), std::string::npos) << error.what();
    }
  }
  EXPECT_THROW(read_link_trace(folder.path() / "none.csv", {}), Error);
}

TEST(LinkModel, is_slower_the_farther_the_profile_reaches) {
  double last_s = 0.0;
  for (const LinkProfile profile :
       {LinkProfile::none, LinkProfile::lan, LinkProfile::wifi, LinkProfile::nr, LinkProfile::lte}) {
    LinkModelOptions options;
    options.profile = profile;
    LinkModel link(options, 1);
    const double arrived_s = link.send(0.0, 1'000'000);
    EXPECT_GT(arrived_s, profile == LinkProfile::none ? -1.0 : last_s);
    last_s = arrived_s;
  }
}

}  // namespace
}  // namespace mapweave::transport
