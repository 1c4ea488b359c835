#pragma once
// A process that is killed while it works.

#include <sys/wait.h>
#include <unistd.h>

#include <gtest/gtest.h>

#include <csignal>
#include <functional>

namespace mapweave::test {

// `work` in a process of its own, which is killed so long after it wrote so many bytes: to the file that it is given.
// How many it wrote.
inline std::size_t killed(const std::function<void(int out)>& work, std::size_t after_bytes, unsigned microseconds) {
  int pipes[2];
  if (pipe(pipes) != 0) {
    ADD_FAILURE() << "no pipe";
    return 0;
  }
  const pid_t child = fork();
  if (child == 0) {
    close(pipes[0]);
    try {
      work(pipes[1]);
    } catch (...) {
      _exit(1);
    }
    _exit(0);
  }
  close(pipes[1]);
  std::size_t count = 0;
  char byte = 0;
  while (count < after_bytes && read(pipes[0], &byte, 1) == 1) ++count;
  usleep(microseconds);
  ::kill(child, SIGKILL);
  while (read(pipes[0], &byte, 1) == 1) ++count;
  int status = 0;
  waitpid(child, &status, 0);
  close(pipes[0]);
  EXPECT_FALSE(WIFEXITED(status) && WEXITSTATUS(status) == 1) << "it threw";
  return count;
}

}  // namespace mapweave::test
