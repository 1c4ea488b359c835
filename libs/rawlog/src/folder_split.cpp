#include "folder_split.h"

#include "picture_lists.h"

#include <mapweave/core/files.h>
#include <mapweave/core/interrupt.h>

#include <algorithm>

namespace mapweave::rawlog {
namespace {

// Removes the parts unless all were written.
class Parts {
 public:
  void add(const std::filesystem::path& folder) {
    std::error_code problem;
    if (std::filesystem::exists(folder, problem))
      throw Error(ErrorCode::kCannotWrite, "the folder exists", folder.string(), "choose another folder, or remove it");
    folders_.push_back(folder);
    make_part_folder(folder);
  }
  void keep() { folders_.clear(); }
  ~Parts() {
    std::error_code ignored;
    for (const auto& folder : folders_) std::filesystem::remove_all(folder, ignored);
  }

 private:
  std::vector<std::filesystem::path> folders_;
};

FolderPart frames_within(const CameraFolder& whole, const TimeRange& time) {
  const auto first_from = [&](Stamp stamp) {
    const auto found = std::lower_bound(whole.frames.begin(), whole.frames.end(), stamp,
                                        [](const FolderFrame& frame, Stamp limit) { return frame.stamp < limit; });
    return static_cast<std::size_t>(found - whole.frames.begin());
  };
  return {first_from(time.first), first_from(time.last), time.first, time.last};
}

}  // namespace

void link_file(const std::filesystem::path& from, const std::filesystem::path& to) {
  make_part_folder(to.parent_path());
  std::error_code problem;
  const auto source = std::filesystem::canonical(from, problem);
  if (problem)
    throw Error(ErrorCode::kMissing, "cannot be opened: " + problem.message(), from.string(),
                "copy the recording again");
  if (std::filesystem::exists(to, problem)) return;  // named twice
  std::filesystem::create_hard_link(source, to, problem);
  if (!problem) return;
  problem.clear();
  std::filesystem::copy_file(source, to, problem);
  if (problem)
    throw Error(ErrorCode::kCannotWrite, "cannot be written: " + problem.message(), to.string(),
                "choose another folder");
}

void copy_if_there(const CameraFolder& whole, const std::filesystem::path& name, const std::filesystem::path& out) {
  std::error_code problem;
  if (!std::filesystem::is_regular_file(whole.folder / name, problem)) return;
  make_part_folder((out / name).parent_path());
  std::filesystem::copy_file(whole.folder / name, out / name, problem);
  if (problem)
    throw Error(ErrorCode::kCannotWrite, "cannot be written: " + problem.message(), (out / name).string(),
                "choose another folder");
}

void write_list(const std::filesystem::path& to, const std::string& text) {
  make_part_folder(to.parent_path());
  write_file(to, text);
}

void cut_imu(const CameraFolder& whole, const FolderPart& part, const std::filesystem::path& out) {
  if (!whole.imu) return;
  const std::string text = read_file(whole.folder / whole.imu->file);
  const char* separators = whole.imu->is_csv ? kCommaSeparated : kBlankSeparated;
  std::string kept;
  std::uint64_t number = 0;
  for (std::size_t begin = 0; begin < text.size();) {
    const auto end = std::min(text.find('\n', begin), text.size() - 1) + 1;
    const std::string line = text.substr(begin, end - begin);
    begin = end;
    Fields fields(std::string_view(line).substr(0, line.find('\n')),
                  (whole.folder / whole.imu->file).string() + ":" + std::to_string(++number), true, separators);
    const auto first = fields.next();
    if (first && first->front() != '#') {
      const Stamp stamp =
          parse_stamp(std::string(*first), whole.imu->is_csv ? StampUnit::kNanoseconds : StampUnit::kSeconds, fields);
      if (stamp < part.from || !(stamp < part.to)) continue;
    }
    kept += line;
  }
  write_list(out / whole.imu->file, kept);
}

std::vector<SplitPart> split_folder(const std::filesystem::path& folder, const std::filesystem::path& out_folder,
                                    const SplitOptions& options, Progress& progress) {
  const FolderLayout& layout = recognise_folder(folder);
  const CameraFolder whole = layout.read(folder, options.reading);
  if (whole.trouble) throw *whole.trouble;
  const TimeRange range{whole.frames.front().stamp, whole.frames.back().stamp};
  const auto cuts = cuts_of(options, [&] { return range; });
  std::vector<FolderPart> parts;
  std::vector<SplitPart> answer;
  for (int i = 0; i < options.robots; ++i) {
    const FolderPart& part = parts.emplace_back(frames_within(whole, part_of(cuts, i, options)));
    SplitPart& described = answer.emplace_back();
    described.path = out_folder / ("robot" + std::to_string(i));
    described.observations = described.frames = part.end - part.begin;
    if (described.frames == 0) continue;
    described.first = to_stamp(to_mrpt_time(whole.frames[part.begin].stamp));  // as the observations have them
    described.last = to_stamp(to_mrpt_time(whole.frames[part.end - 1].stamp));
  }
  expect_parts(folder, cuts, range, answer);

  Parts made;
  ProgressTask task(progress, "splitting " + folder.filename().string(), parts.size(), "parts");
  for (std::size_t i = 0; i < parts.size(); ++i) {
    throw_if_interrupted();
    made.add(answer[i].path);
    layout.write_part(whole, parts[i], answer[i].path);
    cut_imu(whole, parts[i], answer[i].path);
    task.advance(i + 1);
  }
  made.keep();
  return answer;
}

}  // namespace mapweave::rawlog
