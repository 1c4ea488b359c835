#include <mapweave/matching/binary_vocabulary.h>

// The bytes of the file become part of the library, so that no program has to know where it lies.
asm(R"(
    .section .rodata
    .balign 16
mapweave_shipped_vocabulary_begin:
    .incbin ")" MAPWEAVE_SHIPPED_VOCABULARY R"("
mapweave_shipped_vocabulary_end:
    .globl mapweave_shipped_vocabulary_begin
    .globl mapweave_shipped_vocabulary_end
    .text
)");
extern "C" const char mapweave_shipped_vocabulary_begin[], mapweave_shipped_vocabulary_end[];

namespace mapweave::matching {

const BinaryVocabulary& shipped_vocabulary() {
  static const BinaryVocabulary vocabulary =
      parse_vocabulary({mapweave_shipped_vocabulary_begin,
                        static_cast<std::size_t>(mapweave_shipped_vocabulary_end - mapweave_shipped_vocabulary_begin)},
                       "the vocabulary that mapweave brings");
  return vocabulary;
}

}  // namespace mapweave::matching
