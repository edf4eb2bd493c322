#include "own_process.h"

#include <sys/wait.h>
#include <unistd.h>

#include <cstdio>
#include <exception>
#include <stdexcept>

namespace perfect_bvh::bench {
namespace {

// Ends the process without running exit handlers: they belong to the parent.
[[noreturn]] void work_in_child(const std::function<std::vector<double>()>& work, int out) {
  int code = 1;
  try {
    const std::vector<double> numbers = work();
    const std::size_t bytes = numbers.size() * sizeof(double);
    if (write(out, numbers.data(), bytes) == static_cast<ssize_t>(bytes)) code = 0;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
  }
  _exit(code);
}

std::vector<double> read_all(int in) {
  std::vector<double> numbers;
  double number = 0;
  while (read(in, &number, sizeof(number)) == sizeof(number)) numbers.push_back(number);
  return numbers;
}

}  // namespace

std::vector<double> run_in_own_process(const std::function<std::vector<double>()>& work) {
  int ends[2];
  if (pipe(ends) != 0) throw std::runtime_error("no pipe to be had");
  std::fflush(nullptr);
  const pid_t child = fork();
  if (child < 0) throw std::runtime_error("no process to be had");
  if (child == 0) {
    close(ends[0]);
    work_in_child(work, ends[1]);
  }
  close(ends[1]);
  std::vector<double> numbers = read_all(ends[0]);
  close(ends[0]);
  int status = 0;
  if (waitpid(child, &status, 0) != child || !WIFEXITED(status) || WEXITSTATUS(status) != 0) {
    throw std::runtime_error("what ran in a process of its own failed there");
  }
  return numbers;
}

}  // namespace perfect_bvh::bench
