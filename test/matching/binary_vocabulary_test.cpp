#include <gtest/gtest.h>
#include <mapweave/core/error.h>
#include <mapweave/core/files.h>
#include <mapweave/matching/binary_vocabulary.h>
#include <support/temporary_folder.h>

#include <random>

namespace mapweave::matching {
namespace {

using Random = std::mt19937_64;

OrbDescriptor any_descriptor(Random& random) { return {random(), random(), random(), random()}; }
OrbDescriptor with_flips(OrbDescriptor descriptor, int flips, Random& random) {
  for (int i = 0; i < flips; ++i) {
    const std::uint64_t bit = random() % 256;
    descriptor[bit / 64] ^= std::uint64_t{1} << (bit % 64);
  }
  return descriptor;
}

// Six clusters of forty; each picture shows ten of each of two clusters, cluster 0 in all pictures.
struct Planted {
  std::vector<OrbDescriptor> centres;
  VocabularyPictures pictures;
  std::vector<std::size_t> cluster_of;
};
Planted planted(std::uint64_t seed) {
  Random random(seed);
  Planted world;
  for (int i = 0; i < 6; ++i) world.centres.push_back(any_descriptor(random));
  for (std::size_t picture = 0; picture < 20; ++picture) {
    std::vector<OrbDescriptor> features;
    for (const std::size_t cluster : {std::size_t{0}, 1 + picture % 5})
      for (int i = 0; i < 10; ++i) {
        features.push_back(with_flips(world.centres[cluster], 12, random));
        world.cluster_of.push_back(cluster);
      }
    world.pictures.add(features);
  }
  return world;
}

BinaryVocabulary trained(const VocabularyPictures& pictures, int branching, int levels, std::uint64_t seed = 1) {
  VocabularyOptions options;
  options.branching = branching;
  options.levels = levels;
  options.seed = seed;
  return train_vocabulary(pictures, options, *make_silent_progress());
}

TEST(OrbDescriptor, keeps_the_bytes_in_their_order_and_counts_bits_that_differ) {
  std::uint8_t bytes[32];
  for (int i = 0; i < 32; ++i) bytes[i] = static_cast<std::uint8_t>(7 * i + 3);
  const OrbDescriptor descriptor = descriptor_of_bytes(bytes);
  for (std::size_t i = 0; i < 32; ++i) EXPECT_EQ(byte_of(descriptor, i), bytes[i]);
  EXPECT_EQ(descriptor[0] & 0xffff, 0x0a03u);
  OrbDescriptor other = descriptor;
  other[3] ^= 0x8000000000000101u;
  EXPECT_EQ(hamming(descriptor, other), 3);
}

TEST(OrbDescriptor, finds_the_two_nearest_as_brute_force_does) {
  Random random(3);
  std::vector<OrbDescriptor> among;
  for (int i = 0; i < 300; ++i) among.push_back(any_descriptor(random));
  among[200] = among[100];
  std::vector<std::uint32_t> chosen;
  for (std::uint32_t i = 0; i < 300; i += 3) chosen.push_back(i);
  for (int trial = 0; trial < 50; ++trial) {
    const OrbDescriptor query = trial == 0 ? among[100] : any_descriptor(random);
    std::vector<int> distances;
    for (const OrbDescriptor& other : among) distances.push_back(hamming(query, other));
    const auto least = std::min_element(distances.begin(), distances.end());
    const auto nearest = nearest_descriptors(query, among.data(), among.size());
    EXPECT_EQ(nearest.first, least - distances.begin());
    EXPECT_EQ(nearest.distance, *least);
    std::sort(distances.begin(), distances.end());
    EXPECT_EQ(nearest.second_distance, distances[1]);
    const auto of_chosen = nearest_descriptors(query, among.data(), chosen.data(), chosen.size());
    for (const std::uint32_t i : chosen) EXPECT_GE(hamming(query, among[i]), of_chosen.distance);
    EXPECT_EQ(hamming(query, among[chosen[of_chosen.first]]), of_chosen.distance);
  }
  EXPECT_EQ(nearest_descriptors(among[0], among.data(), 0).distance, 257);
}

TEST(VocabularyTraining, finds_planted_clusters_and_their_centres) {
  const Planted world = planted(11);
  const BinaryVocabulary vocabulary = trained(world.pictures, 6, 1);
  ASSERT_EQ(vocabulary.words(), 6U);
  std::vector<std::uint32_t> word_of;
  for (const OrbDescriptor& centre : world.centres) {
    word_of.push_back(vocabulary.find(centre, 1).word);
    EXPECT_LE(hamming(vocabulary.descriptor_of_word(word_of.back()), centre), 2);
  }
  for (std::size_t i = 0; i < world.pictures.descriptors.size(); ++i)
    EXPECT_EQ(vocabulary.find(world.pictures.descriptors[i], 1).word, word_of[world.cluster_of[i]]);
  EXPECT_EQ(vocabulary.weight_of_word(word_of[0]), 0.0);  // in every picture
  EXPECT_NEAR(vocabulary.weight_of_word(word_of[3]), std::log(5.0), 1e-4);
}

TEST(VocabularyTraining, is_the_same_for_the_same_seed_and_another_for_another) {
  const Planted world = planted(11);
  EXPECT_EQ(trained(world.pictures, 3, 4).hash(), trained(world.pictures, 3, 4).hash());
  EXPECT_NE(trained(world.pictures, 3, 4).hash(), trained(world.pictures, 3, 4, 2).hash());
}

TEST(VocabularyTraining, ends_where_descriptors_are_all_alike) {
  VocabularyPictures pictures;
  pictures.add(std::vector<OrbDescriptor>(50, OrbDescriptor{1, 2, 3, 4}));
  pictures.add({});
  const BinaryVocabulary vocabulary = trained(pictures, 10, 6);
  EXPECT_EQ(vocabulary.words(), 1U);
  EXPECT_EQ(vocabulary.nodes(), 1U);
  EXPECT_NEAR(vocabulary.weight_of_word(0), std::log(2.0), 1e-4);  // the second picture does not show it
}

TEST(VocabularyTraining, asks_for_features_and_for_sound_options) {
  VocabularyPictures pictures;
  pictures.add({});
  EXPECT_THROW(trained(pictures, 10, 4), Error);
  pictures.add({OrbDescriptor{}});
  EXPECT_THROW(trained(pictures, 1, 4), Error);
}

TEST(BinaryVocabulary, descends_to_the_nearest_child_at_each_level) {
  const Planted world = planted(5);
  const BinaryVocabulary vocabulary = trained(world.pictures, 3, 3);
  Random random(9);
  for (int trial = 0; trial < 100; ++trial) {
    const OrbDescriptor query = any_descriptor(random);
    const auto place = vocabulary.find(query, 8);
    EXPECT_EQ(vocabulary.find(query, 3).node, place.node);  // deeper than the leaf is the leaf
    EXPECT_LT(vocabulary.find(query, 1).node, 3U);
    EXPECT_LT(vocabulary.find(query, 1).node, vocabulary.find(query, 2).node);
    int least = 257;
    for (std::uint32_t child = 0; child < 3; ++child)
      least = std::min(least, hamming(query, vocabulary.descriptor_of_node(child)));
    EXPECT_EQ(hamming(query, vocabulary.descriptor_of_node(vocabulary.find(query, 1).node)), least);
  }
}

TEST(BinaryVocabulary, puts_whole_pictures_into_bags_that_add_up) {
  const Planted world = planted(5);
  const BinaryVocabulary vocabulary = trained(world.pictures, 6, 2);
  const std::vector<OrbDescriptor> first(world.pictures.descriptors.begin(), world.pictures.descriptors.begin() + 20);
  const std::vector<OrbDescriptor> second(world.pictures.descriptors.begin() + 20,
                                          world.pictures.descriptors.begin() + 40);
  const DescribedPicture a = vocabulary.describe_picture(first), b = vocabulary.describe_picture(second);
  EXPECT_EQ(a.node_of_feature.size(), 20U);
  int sum = 0;
  for (std::size_t i = 0; i < a.bag.size(); ++i) {
    sum += a.bag[i].share;
    if (i > 0) {
      EXPECT_LT(a.bag[i - 1].word, a.bag[i].word);
    }
  }
  EXPECT_LE(sum, kWholeBag);
  EXPECT_GE(sum, kWholeBag - 20);
  EXPECT_EQ(common_share(a.bag, a.bag), sum);
  EXPECT_EQ(common_share(a.bag, b.bag), common_share(b.bag, a.bag));
  EXPECT_LT(common_share(a.bag, b.bag), sum);
  EXPECT_TRUE(vocabulary.describe_picture({}).bag.empty());
}

TEST(BinaryVocabulary, is_the_same_after_a_file) {
  const test::TemporaryFolder folder;
  const BinaryVocabulary vocabulary = trained(planted(5).pictures, 4, 3);
  const auto path = folder.path() / "words.txt.gz";
  save_vocabulary(vocabulary, path);
  const BinaryVocabulary again = load_vocabulary(path);
  EXPECT_EQ(again.hash(), vocabulary.hash());
  EXPECT_EQ(again.words(), vocabulary.words());
  const std::string bytes = read_file(path);
  save_vocabulary(again, path);
  EXPECT_EQ(read_file(path), bytes);
}

std::string line(std::int64_t parent, int leaf, int byte, const std::string& weight = "0.5") {
  std::string text = std::to_string(parent) + " " + std::to_string(leaf);
  for (int i = 0; i < 32; ++i) text += " " + std::to_string(byte);
  return text + " " + weight + "\n";
}

TEST(VocabularyFile, reads_the_plain_layout_in_any_order_of_branches) {
  const BinaryVocabulary by_levels =
      parse_vocabulary("2 2 0 0\n" + line(0, 0, 1) + line(0, 1, 254) + line(1, 1, 3) + line(1, 1, 7), "text");
  const BinaryVocabulary by_branches =
      parse_vocabulary("2 2  0 0 \r\n" + line(0, 0, 1, "0") + line(1, 1, 3) + line(1, 1, 7) + line(0, 1, 254), "text");
  EXPECT_EQ(by_levels.hash(), by_branches.hash());
  EXPECT_EQ(by_levels.words(), 3U);
  EXPECT_EQ(by_levels.nodes(), 4U);
}

TEST(ShippedVocabulary, holds_ten_thousand_words) {
  const BinaryVocabulary& vocabulary = shipped_vocabulary();
  EXPECT_EQ(vocabulary.words(), 10000U);
  EXPECT_EQ(vocabulary.levels(), 4);
  EXPECT_EQ(&shipped_vocabulary(), &vocabulary);
}

TEST(ChosenVocabulary, is_the_shipped_one_unless_another_is_given) {
  EXPECT_EQ(&ChosenVocabulary().get(), &shipped_vocabulary());
  const BinaryVocabulary own = trained(planted(1).pictures, 3, 2);
  const ChosenVocabulary given(own);
  EXPECT_TRUE(given.is_given());
  EXPECT_EQ(given.get().hash(), own.hash());
}

TEST(VocabularyFile, names_the_line_that_is_wrong) {
  const std::string head = "2 2 0 0\n", good = line(0, 1, 5);
  const auto message = [](const std::string& text) -> std::string {
    try {
      parse_vocabulary(text, "words.txt");
    } catch (const Error& error) {
      EXPECT_TRUE(error.code() == ErrorCode::kCorrupt || error.code() == ErrorCode::kUnsupported);
      return error.what();
    }
    return "accepted";
  };
  EXPECT_THAT(message(head + good), testing::HasSubstr("accepted"));
  EXPECT_THAT(message(""), testing::HasSubstr("no nodes"));
  EXPECT_THAT(message(head), testing::HasSubstr("no nodes"));
  EXPECT_THAT(message("%YAML:1.0\n"), testing::HasSubstr("words.txt:1"));
  EXPECT_THAT(message("1 2 0 0\n" + good), testing::HasSubstr("branches is 1"));
  EXPECT_THAT(message("2 99 0 0\n" + good), testing::HasSubstr("levels is 99"));
  EXPECT_THAT(message("2 2 5 0\n" + good), testing::HasSubstr("L1"));
  EXPECT_THAT(message("2 2 0 3\n" + good), testing::HasSubstr("tf-idf"));
  EXPECT_THAT(message(head + line(1, 1, 5)), testing::HasSubstr("words.txt:2: the parent 1"));
  EXPECT_THAT(message(head + line(-1, 1, 5)), testing::HasSubstr("parent's number"));
  EXPECT_THAT(message(head + line(4294967295, 1, 5)), testing::HasSubstr("words.txt:2"));
  EXPECT_THAT(message(head + good + line(1, 1, 5)), testing::HasSubstr("is a leaf"));
  EXPECT_THAT(message(head + good + good + good), testing::HasSubstr("words.txt:4: node 0 has too many"));
  EXPECT_THAT(message(head + line(0, 0, 5)), testing::HasSubstr("neither a leaf"));
  EXPECT_THAT(message(head + line(0, 0, 5) + line(1, 0, 5) + line(2, 1, 5)), testing::HasSubstr("deeper"));
  EXPECT_THAT(message(head + line(0, 2, 5)), testing::HasSubstr("leaf is 2"));
  EXPECT_THAT(message(head + line(0, 1, 256)), testing::HasSubstr("256"));
  EXPECT_THAT(message(head + line(0, 1, 5, "nan")), testing::HasSubstr("weight"));
  EXPECT_THAT(message(head + line(0, 1, 5, "-1")), testing::HasSubstr("weight"));
  EXPECT_THAT(message(head + line(0, 1, 5, "1e999")), testing::HasSubstr("weight"));
  EXPECT_THAT(message(head + line(0, 1, 5, "0.5 7")), testing::HasSubstr("more on the line"));
  EXPECT_THAT(message(head + good.substr(0, 40)), testing::HasSubstr("words.txt:2"));
  EXPECT_THAT(message(head + std::string(100000, ' ')), testing::HasSubstr("longer"));
}

TEST(VocabularyFile, survives_a_file_cut_or_changed_anywhere) {
  const test::TemporaryFolder folder;
  const auto path = folder.path() / "words.txt.gz";
  save_vocabulary(trained(planted(5).pictures, 4, 2), path);
  const std::string bytes = read_file(path);
  for (std::size_t size = 0; size < bytes.size(); ++size)
    EXPECT_THROW(parse_vocabulary(std::string_view(bytes).substr(0, size), "cut"), Error) << size;
  EXPECT_THROW(parse_vocabulary(bytes + "x", "longer"), Error);
  for (std::size_t place = 0; place < bytes.size(); ++place) {
    std::string changed = bytes;
    changed[place] = static_cast<char>(changed[place] ^ 0x55);
    try {
      parse_vocabulary(changed, "changed");  // bytes 4 to 9 of a gz head mean nothing
      EXPECT_TRUE(place >= 3 && place <= 9) << place;
    } catch (const Error&) {}
  }
  EXPECT_THROW(load_vocabulary(folder.path() / "none"), Error);
}

}  // namespace
}  // namespace mapweave::matching
