// mapweave vocabulary: trains the words by which cameras know places again, and shows what is in a file of them.

#include "command.h"
#include "command_line.h"

#include <mapweave/core/error.h>
#include <mapweave/core/interrupt.h>
#include <mapweave/core/options.h>
#include <mapweave/matching/binary_vocabulary.h>
#include <mapweave/matching/orb_features.h>
#include <mapweave/rawlog/observation_stream.h>
#include <mapweave/runtime/json_text.h>
#include <mrpt/obs/CObservation3DRangeScan.h>
#include <mrpt/obs/CObservationImage.h>
#include <mrpt/obs/CObservationStereoImages.h>

#include <nlohmann/json.hpp>

#include <algorithm>
#include <cstdio>
#include <iostream>
#include <map>
#include <memory>

namespace mapweave::app {
namespace {

using Json = nlohmann::ordered_json;

struct TrainingArguments {
  std::vector<std::string> logs;
  std::filesystem::path out;
  std::uint64_t every = 5;
  matching::VocabularyOptions words;
  matching::OrbFeatureOptions features;
  rawlog::ReadOptions reading;
  bool force = false, json = false;
};

// The picture of an observation; of a stereo pair the left one. nullptr for other sensors.
const mrpt::img::CImage* picture_of(const mrpt::obs::CObservation& observation) {
  if (const auto* single = dynamic_cast<const mrpt::obs::CObservationImage*>(&observation)) return &single->image;
  if (const auto* pair = dynamic_cast<const mrpt::obs::CObservationStereoImages*>(&observation))
    return &pair->imageLeft;
  if (const auto* depth = dynamic_cast<const mrpt::obs::CObservation3DRangeScan*>(&observation))
    return depth->hasIntensityImage ? &depth->intensityImage : nullptr;
  return nullptr;
}

std::vector<matching::OrbDescriptor> features_of(const mrpt::img::CImage& picture,
                                                 const matching::OrbFeatureOptions& options) {
  const mrpt::img::CImage grey = picture.isColor() ? picture.grayscale() : picture;
  const matching::PictureView view{grey.ptrLine<std::uint8_t>(0), static_cast<int>(grey.getWidth()),
                                   static_cast<int>(grey.getHeight()), grey.getRowStride()};
  return matching::orb_features(view, options).descriptors;
}

// Each sensor's pictures are counted by themselves, from the first of each log.
std::uint64_t add_log(const std::string& log, const TrainingArguments& arguments, Progress& progress,
                      matching::VocabularyPictures& pictures) {
  const auto stream = rawlog::open_log(log, arguments.reading);
  ProgressTask task(progress, log, stream->bytes_total() >> 20, "MB");
  std::map<std::string, std::uint64_t> seen;
  std::uint64_t used = 0;
  while (const auto record = stream->next()) {
    throw_if_interrupted();
    const mrpt::img::CImage* picture = picture_of(*record->observation);
    if (picture == nullptr || seen[record->observation->sensorLabel]++ % arguments.every != 0) continue;
    rawlog::load_pictures(*record->observation);
    pictures.add(features_of(*picture, arguments.features));
    record->observation->unload();
    task.advance(stream->bytes_read() >> 20);
    ++used;
  }
  return used;
}

Json json_of(const matching::BinaryVocabulary& vocabulary) {
  double least = 0.0, most = 0.0, sum = 0.0;
  for (std::uint32_t word = 0; word < vocabulary.words(); ++word) {
    const double weight = vocabulary.weight_of_word(word);
    least = word == 0 ? weight : std::min(least, weight);
    most = std::max(most, weight);
    sum += weight;
  }
  return {{"branching", vocabulary.branching()},
          {"levels", vocabulary.levels()},
          {"nodes", vocabulary.nodes()},
          {"words", vocabulary.words()},
          {"weight_least", least},
          {"weight_mean", sum / static_cast<double>(vocabulary.words())},
          {"weight_most", most},
          {"hash", to_hex(vocabulary.hash())}};
}

void print(const Json& report, bool json) {
  if (json) {
    std::cout << runtime::json_text(report) << '\n';
    return;
  }
  for (const auto& [key, value] : report.items())
    std::cout << key << ": " << (value.is_string() ? value.get<std::string>() : runtime::json_text(value, -1)) << '\n';
}

ExitCode train(const TrainingArguments& arguments) {
  if (!arguments.force && std::filesystem::exists(arguments.out))
    throw Error(ErrorCode::kCannotWrite, "the file exists", arguments.out.string(),
                "choose another name, or replace it with --force");
  const std::filesystem::path folder = std::filesystem::absolute(arguments.out).parent_path();
  if (!std::filesystem::is_directory(folder))
    throw Error(ErrorCode::kCannotWrite, "there is no such folder", folder.string(), "make it, or choose another");
  check(arguments.words);
  check(arguments.features);
  const auto progress = make_terminal_progress();
  matching::VocabularyPictures pictures;
  for (const std::string& log : arguments.logs)
    if (add_log(log, arguments, *progress, pictures) == 0)
      throw Error(ErrorCode::kBadInput, "no pictures in it", log,
                  "name logs of cameras ('mapweave inspect' shows what is in a log)");
  const matching::BinaryVocabulary vocabulary = matching::train_vocabulary(pictures, arguments.words, *progress);
  matching::save_vocabulary(vocabulary, arguments.out);
  Json report = {{"vocabulary", arguments.out.string()},
                 {"pictures", pictures.ends.size()},
                 {"features", pictures.descriptors.size()}};
  report.update(json_of(vocabulary));
  print(report, arguments.json);
  return ExitCode::done;
}

}  // namespace

Action set_up_vocabulary(CLI::App& verb) {
  const auto training = std::make_shared<TrainingArguments>();
  verb.require_subcommand(1);
  CLI::App* train_verb = verb.add_subcommand("train", "pictures of logs -> a vocabulary");
  train_verb->add_option("LOG_OR_FOLDER", training->logs, "recordings of cameras")->required();
  train_verb->add_option("-o,--out", training->out, "vocabulary to write")->required()->type_name("FILE.txt.gz");
  train_verb
      ->add_option("--branching", training->words.branching,
                   "most children of a node of the tree of words; larger values give more words")
      ->check(whole_number(2, 32))
      ->capture_default_str();
  train_verb
      ->add_option("--levels", training->words.levels,
                   "most levels of the tree of words; larger values give more words")
      ->check(whole_number(1, 8))
      ->capture_default_str();
  train_verb
      ->add_option("--seed", training->words.seed,
                   "seed of all random numbers; the same seed gives the same vocabulary")
      ->check(whole_number(0, 4294967295))
      ->capture_default_str();
  train_verb->add_option("--every", training->every, "use every n-th picture of the logs; larger values are faster")
      ->check(whole_number(1, 1000000))
      ->capture_default_str();
  train_verb->add_option("--features", training->features.features, "most features that are taken from a picture")
      ->check(whole_number(10, 100000))
      ->capture_default_str();
  train_verb->add_flag("--force", training->force, "replace an old file");
  show_examples(*train_verb, {"mapweave vocabulary train alpha.rawlog --out words.txt.gz"});

  const auto file = std::make_shared<std::filesystem::path>();
  CLI::App* info_verb = verb.add_subcommand("info", "what is in a vocabulary");
  info_verb->add_option("FILE", *file,
                        "vocabulary (DBoW2's text layout, gz or plain); without it: the one that mapweave brings");
  show_examples(*info_verb, {"mapweave vocabulary info words.txt.gz"});
  for (CLI::App* each : {train_verb, info_verb}) each->add_flag("--json", training->json, "print JSON");
  return [=] {
    if (train_verb->parsed()) return train(*training);
    print(json_of(file->empty() ? matching::shipped_vocabulary() : matching::load_vocabulary(*file)), training->json);
    return ExitCode::done;
  };
}

}  // namespace mapweave::app
