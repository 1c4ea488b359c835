#include <gtest/gtest.h>
#include <mapweave/core/interrupt.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>

namespace mapweave {
namespace {

// In a child process, so that the handlers do not stay. Its exit status says what it saw.
template <class Function>
int exit_status_of(Function function) {
  const pid_t child = ::fork();
  if (child == 0) ::_exit(function());
  int status = 0;
  ::waitpid(child, &status, 0);
  return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

TEST(Interrupt, is_thrown_at_the_next_safe_point_and_is_no_failure) {
  clear_interrupt();
  EXPECT_FALSE(interrupted());
  EXPECT_NO_THROW(throw_if_interrupted());
  request_interrupt();
  EXPECT_TRUE(interrupted());
  try {
    throw_if_interrupted();
    ADD_FAILURE() << "nothing was thrown";
  } catch (const std::exception&) {
    ADD_FAILURE() << "it was taken for a failure";
  } catch (const Interrupted& interrupted) {
    EXPECT_EQ(interrupted.message(), "interrupted");
  }
  clear_interrupt();
  EXPECT_NO_THROW(throw_if_interrupted());
}

TEST(Interrupt, comes_with_either_signal_and_lets_the_program_go_on) {
  for (const int number : {SIGINT, SIGTERM}) {
    EXPECT_EQ(exit_status_of([number] {
                install_interrupt_handlers();
                ::raise(number);
                return interrupted() ? 42 : 43;
              }),
              42);
  }
}

TEST(Interrupt, ends_the_program_at_the_second_signal) {
  EXPECT_EQ(exit_status_of([] {
              install_interrupt_handlers();
              ::raise(SIGINT);
              ::raise(SIGTERM);
              return 43;
            }),
            130);
}

}  // namespace
}  // namespace mapweave
