#pragma once
// What a thread that serves spends, and how it gives way to those that are in a hurry.

#include <mapweave/core/stopwatch.h>

#include <chrono>

namespace mapweave::runtime {

using Clock = std::chrono::steady_clock;

// Of this thread and those that it starts; one that may not ask for it goes on as it is.
void lower_priority();

// Adds the thread's processor time until its end.
class Spending {
 public:
  explicit Spending(double& sum_s);
  ~Spending();
  Spending(const Spending&) = delete;
  Spending& operator=(const Spending&) = delete;

 private:
  double& sum_s_;
  const double begin_s_;
};

}  // namespace mapweave::runtime
