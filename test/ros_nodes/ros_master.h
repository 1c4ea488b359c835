#pragma once
// A master of ROS of the test's own, and a node that talks to it.

#include <arpa/inet.h>
#include <ros/ros.h>
#include <support/temporary_folder.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <csignal>
#include <cstdlib>
#include <functional>
#include <memory>
#include <string>
#include <thread>
#include <utility>
#include <vector>

namespace mapweave::test {

inline std::uint16_t free_port() {
  const int socket = ::socket(AF_INET, SOCK_STREAM, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  socklen_t size = sizeof address;
  auto* generic = reinterpret_cast<sockaddr*>(&address);
  if (::bind(socket, generic, size) != 0 || ::getsockname(socket, generic, &size) != 0) std::abort();
  ::close(socket);
  return ntohs(address.sin_port);
}

inline bool eventually(const std::function<bool()>& condition, double patience_s = 30.0) {
  const auto end = std::chrono::steady_clock::now() + std::chrono::duration<double>(patience_s);
  while (!condition()) {
    if (std::chrono::steady_clock::now() > end) return false;
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
  return true;
}

// A program of Debian's Python, which ends with the test.
class PythonProcess {
 public:
  PythonProcess(const std::vector<std::string>& arguments, const std::filesystem::path& log) {
    std::vector<std::string> words = {"/usr/bin/python3"};
    words.insert(words.end(), arguments.begin(), arguments.end());
    std::vector<char*> pointers;
    for (std::string& word : words) pointers.push_back(word.data());
    pointers.push_back(nullptr);
    process_ = ::fork();
    if (process_ != 0) return;
    ::prctl(PR_SET_PDEATHSIG, SIGKILL);
    if (std::freopen(log.c_str(), "w", stdout) == nullptr || ::dup2(1, 2) < 0) ::_exit(126);
    ::execv(pointers.front(), pointers.data());
    ::_exit(127);
  }
  ~PythonProcess() {
    if (process_ <= 0) return;
    ::kill(process_, SIGKILL);
    ::waitpid(process_, nullptr, 0);
  }
  PythonProcess(const PythonProcess&) = delete;
  PythonProcess& operator=(const PythonProcess&) = delete;
  int wait() {
    int status = -1;
    ::waitpid(std::exchange(process_, 0), &status, 0);
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  }

 private:
  pid_t process_ = 0;
};

// One for the whole process: roscpp begins once.
class RosMaster {
 public:
  explicit RosMaster(const std::string& rosmaster) {
    const std::string port = std::to_string(free_port());
    ::setenv("ROS_MASTER_URI", ("http://127.0.0.1:" + port).c_str(), 1);
    ::setenv("ROS_IP", "127.0.0.1", 1);
    ::setenv("ROS_HOME", folder_.path().c_str(), 1);
    ::unsetenv("ROS_HOSTNAME");
    ::unsetenv("ROS_NAMESPACE");
    process_ = std::make_unique<PythonProcess>(std::vector<std::string>{rosmaster, "--core", "-p", port},
                                               folder_ / "master.log");
    ros::init(ros::M_string{}, "mapweave_test", ros::init_options::NoSigintHandler | ros::init_options::NoRosout);
    is_up_ = eventually([] { return ros::master::check(); });
  }
  ~RosMaster() { ros::shutdown(); }
  bool is_up() const { return is_up_; }
  const TemporaryFolder& folder() const { return folder_; }

 private:
  TemporaryFolder folder_;
  std::unique_ptr<PythonProcess> process_;
  bool is_up_ = false;
};

}  // namespace mapweave::test
