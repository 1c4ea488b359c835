#include "spent_time.h"

#include <mapweave/runtime/metrics.h>

#include <sys/resource.h>
#include <sys/syscall.h>
#include <unistd.h>

namespace mapweave::runtime {

void lower_priority() {
  constexpr int kNice = 10;
  const auto thread = static_cast<id_t>(syscall(SYS_gettid));
  setpriority(PRIO_PROCESS, thread, getpriority(PRIO_PROCESS, thread) + kNice);
}

Spending::Spending(double& sum_s) : sum_s_(sum_s), begin_s_(thread_cpu_seconds()) {}
Spending::~Spending() { sum_s_ += thread_cpu_seconds() - begin_s_; }

}  // namespace mapweave::runtime
