// What all tests include is precompiled for this target (test/CMakeLists.txt); it has nothing of its own.
