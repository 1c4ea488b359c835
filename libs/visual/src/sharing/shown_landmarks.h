#pragma once
// When a picture shows a place that other clients know: their landmarks are looked for around where they should be, in
// a wide reach and then in a narrow one.

namespace mapweave::visual {

constexpr double kFar = 0.05, kClose = 0.015;  // widths of the picture: where a landmark is looked for
constexpr int kLeastShown = 20;                // landmarks: of fewer, a share says nothing
constexpr double kShownShare = 0.6;            // of the landmarks found

}  // namespace mapweave::visual
