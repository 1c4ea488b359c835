// A target as a program without libFuzzer: its seeds, then mutations of them for some seconds, the same ones in the
// same order each time; or files that libFuzzer kept.
//   fuzz_NAME [SECONDS]      unless said otherwise FUZZ_SECONDS of the environment, or 1
//   fuzz_NAME FILE...
// An input that ends the process is left in fuzz_NAME.input in the working folder.

#include "fuzz_target.h"
#include "mutation.h"

#include <fcntl.h>
#include <mapweave/core/log.h>
#include <signal.h>
#include <sys/resource.h>
#include <unistd.h>

#include <chrono>
#include <cstdio>
#include <cstdlib>

#if defined(__SANITIZE_ADDRESS__)
extern "C" const char* __asan_default_options();
extern "C" const char* __asan_default_options() {
  return "abort_on_error=1:handle_abort=0:max_allocation_size_mb=600:hard_rss_limit_mb=2048";
}
constexpr bool kHasSanitizer = true;
#else
constexpr bool kHasSanitizer = false;
#endif

namespace mapweave::fuzz {
namespace {

constexpr unsigned kMostSeconds = 20;            // of one input
constexpr rlim_t kMostMemory = rlim_t{2} << 30;  // of the process
constexpr std::size_t kSmallestRounds = 50;      // of mutations, however slow they are

std::string_view current;  // what is being decoded
std::string kept_name;

void keep_and_end(int signal) {
  const int file = ::open(kept_name.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0644);
  const bool is_kept = file >= 0 && ::write(file, current.data(), current.size()) >= 0;
  static constexpr char kSaid[] = "the input is kept in the working folder\n";
  if (is_kept) (void)!::write(STDERR_FILENO, kSaid, sizeof kSaid - 1);
  ::signal(signal, SIG_DFL);
  ::raise(signal);
}

void decode_watched(std::string_view bytes) {
  current = bytes;
  ::alarm(kMostSeconds);
  expect_decoded_or_refused(bytes);
  ::alarm(0);
}

std::string answer_to(std::string_view bytes) {
  try {
    decode(bytes);
    return "decoded";
  } catch (const Error& error) {
    return std::string("refused: ") + error.what();
  }
}

void replay(double seconds) {
  using Clock = std::chrono::steady_clock;
  const auto began = Clock::now();
  const auto passed = [&] { return std::chrono::duration<double>(Clock::now() - began).count(); };
  const std::vector<std::string> all = seeds();
  expect(!all.empty(), "seeds");
  for (const std::string& seed : all) {
    current = seed;
    try {
      decode(seed);
    } catch (const Error& error) {
      expect(false, std::string("a sound seed: ") + error.what());
    }
  }
  std::mt19937_64 random(1);
  std::size_t rounds = 0;
  for (; rounds < kSmallestRounds || passed() < seconds; ++rounds) decode_watched(mutated(all, random));
  std::printf("%zu seeds, %zu mutations in %.1f s\n", all.size(), rounds, passed());
}

int run(int argc, char** argv) {
  set_log_level(LogLevel::error);  // warnings of what is read thousands of times
  kept_name = std::filesystem::path(argv[0]).filename().string() + ".input";
  for (const int signal : {SIGABRT, SIGALRM}) ::signal(signal, keep_and_end);
  if (!kHasSanitizer) {
    for (const int signal : {SIGSEGV, SIGBUS, SIGFPE}) ::signal(signal, keep_and_end);
    const rlimit limit{kMostMemory, kMostMemory};
    ::setrlimit(RLIMIT_AS, &limit);
  }
  const char* asked = argc < 2 ? std::getenv("FUZZ_SECONDS") : argv[1];
  char* end = nullptr;
  const double seconds = asked == nullptr ? 1.0 : std::strtod(asked, &end);
  if (argc < 2 || (argc == 2 && *end == '\0')) {
    replay(seconds);
    return 0;
  }
  for (int i = 1; i < argc; ++i) {
    const std::string bytes = file_bytes(argv[i]);
    decode_watched(bytes);
    std::printf("%s: %s\n", argv[i], answer_to(bytes).c_str());
  }
  return 0;
}

}  // namespace
}  // namespace mapweave::fuzz

int main(int argc, char** argv) { return mapweave::fuzz::run(argc, argv); }
