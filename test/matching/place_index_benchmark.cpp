// Milliseconds of one query for keyframes of 1000 features, by the number of keyframes. The words are as frequent as
// the shipped vocabulary's weights distinguish them, and those of one place come together.
#include <mapweave/matching/place_index.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <random>

using namespace mapweave;
using namespace mapweave::matching;

namespace {

// Words drawn by their frequency: exp(-weight) of all pictures show the word.
class Words {
 public:
  explicit Words(const BinaryVocabulary& vocabulary) {
    for (std::uint32_t word = 0; word < vocabulary.words(); ++word)
      sums_.push_back((sums_.empty() ? 0.0 : sums_.back()) + std::exp(-vocabulary.weight_of_word(word)));
  }
  std::uint32_t draw(std::mt19937_64& random) const {
    const double at = static_cast<double>(random() >> 11) * 0x1p-53 * sums_.back();
    return static_cast<std::uint32_t>(std::upper_bound(sums_.begin(), sums_.end(), at) - sums_.begin());
  }

 private:
  std::vector<double> sums_;
};

}  // namespace

int main() {
  const BinaryVocabulary& vocabulary = shipped_vocabulary();
  const Words words(vocabulary);
  std::mt19937_64 random(1);
  constexpr std::uint32_t kKeyframes = 10000, kAtOnePlace = 20;
  std::vector<OrbDescriptor> place, picture;
  const auto look = [&] {  // half of a picture's words are the place's
    picture.clear();
    for (std::size_t i = 0; i < 1000; ++i)
      picture.push_back(i < 500 ? place[random() % place.size()] : vocabulary.descriptor_of_word(words.draw(random)));
    return vocabulary.describe_picture(picture).bag;
  };
  PlaceIndex index(vocabulary.words());
  std::vector<BagOfWords> queries;
  for (std::uint32_t i = 0; i < kKeyframes; ++i) {
    if (i % kAtOnePlace == 0) {
      place.clear();
      for (int j = 0; j < 1500; ++j) place.push_back(vocabulary.descriptor_of_word(words.draw(random)));
      queries.push_back(look());
    }
    index.add({{{RobotId("alpha"), SensorId("camera")}, 1}, i}, look());
    if ((i + 1) % 2500 != 0) continue;
    std::vector<double> seconds;
    int sum = 0;
    for (const BagOfWords& query : queries) {
      const std::clock_t start = std::clock();  // of the processor: the machine may be busy
      sum += index.query(query, 10).front().score;
      seconds.push_back(static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC);
    }
    std::sort(seconds.begin(), seconds.end());
    std::printf("%5u keyframes: median %.2f ms, 99 %% within %.2f ms; %.1f kB a keyframe (sum %d)\n", i + 1,
                1e3 * seconds[seconds.size() / 2], 1e3 * seconds[seconds.size() * 99 / 100],
                1e-3 * static_cast<double>(index.bytes()) / (i + 1), sum);
  }
}
