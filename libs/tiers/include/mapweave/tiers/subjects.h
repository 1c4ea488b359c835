#pragma once
// Subjects of what tiers send each other (transport/channel.h): what a message is.

namespace mapweave::tiers::subject {

// A camera's client -> its map server: encoded Hello, MapUpdate, ClientView, PlaceRequest; at its end, what it has of
// what the server keeps for it (Receipts). Updates are numbered, each map's by itself, and repeated until a receipt
// names them; the others are sent once.
inline constexpr char kHello[] = "hello", kUpdate[] = "update", kView[] = "view", kPlaceRequest[] = "place_request",
                      kKeptRequest[] = "kept_request";
// Server -> client: encoded Receipts (welcome: of all that is stored, the answer to hello; receipts: of what was
// updated since), Share, PlaceAnswer, Refusal; parts of a KeptMap that the client lacks, as many as there is room for,
// then how many there are of each map (Receipts).
inline constexpr char kWelcome[] = "welcome", kReceipts[] = "receipts", kShare[] = "share", kPlace[] = "place",
                      kRefusal[] = "refusal", kKept[] = "kept", kKeptEnd[] = "kept_end";

// Robots with lasers, edges and the cloud, where each is a program of its own; all are numbered. Robot -> edge: Sensed.
inline constexpr char kSensed[] = "sensed";
// Edge -> cloud. Previews: a round is its updates and merges, then its end. What the final map rests on: MapUpdates and
// MergedMaps as EdgeServer sends them, then that it has fused; with a coordinator, first whose they are, in place of
// all that the edge said of this before. For the folder of results: each robot's whole map and report. Answers:
// judgements and whole maps as MapUpdates, then that this is all; of whole maps with the words of `wanted`.
inline constexpr char kPreviewUpdate[] = "preview_update", kPreviewMerged[] = "preview_merged",
                      kPreviewEnd[] = "preview_end", kFinalBegin[] = "final_begin", kFinalUpdate[] = "final_update",
                      kMerged[] = "merged", kFused[] = "fused", kRobotMap[] = "robot_map",
                      kRobotReport[] = "robot_report", kJudged[] = "judged", kWholeMaps[] = "whole_maps";
// Cloud -> edge: a judging task, as its maps and then its pairs; maps that it wants as a whole; that all is done.
inline constexpr char kJudgeMap[] = "judge_map", kJudge[] = "judge", kWanted[] = "wanted", kDone[] = "done";

}  // namespace mapweave::tiers::subject
