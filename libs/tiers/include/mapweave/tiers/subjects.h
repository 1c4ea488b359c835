#pragma once
// Subjects of what a camera client and its map server send each other (transport/channel.h): what a message is.

namespace mapweave::tiers::subject {

// Client -> server: encoded Hello, MapUpdate, ClientView, PlaceRequest. Updates are numbered, each map's by itself, and
// repeated until a receipt names them; the others are sent once.
inline constexpr char kHello[] = "hello", kUpdate[] = "update", kView[] = "view", kPlaceRequest[] = "place_request";
// Server -> client: encoded Receipts (welcome: of all that is stored, the answer to hello; receipts: of what was
// updated since), Share, PlaceAnswer, Refusal.
inline constexpr char kWelcome[] = "welcome", kReceipts[] = "receipts", kShare[] = "share", kPlace[] = "place",
                      kRefusal[] = "refusal";

}  // namespace mapweave::tiers::subject
