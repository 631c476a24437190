/* Preloaded into dpkg and all that it starts: what happens before each change of a file is said by CUT_AT.
 * N: at change number N the power fails; count: nothing; watch: a change before which the box would not start
 * is written to CUT_LOG. The number of changes so far is the size of the file CUT_LOG.n. CUT_FD: the disk. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <fcntl.h>
#include <signal.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/stat.h>
#include <unistd.h>

#define SHUTDOWN 0x8004587Du /* FS_IOC_SHUTDOWN */
#define HOME "/opt/bunraku/current"

static int would_start(void) {
    struct stat found;
    return access(HOME "/bin/bunraku", X_OK) == 0 && access(HOME "/release", R_OK) == 0 &&
           access(HOME "/bunraku-release", X_OK) == 0 && stat("/usr/lib/systemd/system/bunraku.target", &found) == 0 &&
           access("/usr/bin/bunraku", X_OK) == 0;
}

static void before(const char *what, const char *path) {
    const char *at = getenv("CUT_AT"), *log = getenv("CUT_LOG");
    char name[4096];
    if (at == NULL || log == NULL) return;
    snprintf(name, sizeof name, "%s.n", log);
    int counter = open(name, O_WRONLY | O_CREAT | O_APPEND, 0666);
    if (write(counter, ".", 1) != 1) abort();
    long number = lseek(counter, 0, SEEK_END);
    close(counter);
    if (strcmp(at, "watch") == 0 && !would_start()) {
        FILE *lines = fopen(log, "a");
        fprintf(lines, "%s %s\n", what, path);
        fclose(lines);
    } else if (number == atol(at)) {
        uint32_t without_flushing = 2;
        ioctl(atoi(getenv("CUT_FD")), SHUTDOWN, &without_flushing);
        kill(getpid(), SIGKILL);
    }
}

#define CHANGE(name, parameters, arguments, path)       \
    int name parameters {                               \
        int(*real) parameters = dlsym(RTLD_NEXT, #name); \
        before(#name, path);                            \
        return real arguments;                          \
    }

CHANGE(rename, (const char *from, const char *to), (from, to), to)
CHANGE(renameat, (int a, const char *from, int b, const char *to), (a, from, b, to), to)
CHANGE(renameat2, (int a, const char *from, int b, const char *to, unsigned f), (a, from, b, to, f), to)
CHANGE(link, (const char *from, const char *to), (from, to), to)
CHANGE(linkat, (int a, const char *from, int b, const char *to, int f), (a, from, b, to, f), to)
CHANGE(symlink, (const char *from, const char *to), (from, to), to)
CHANGE(symlinkat, (const char *from, int a, const char *to), (from, a, to), to)
CHANGE(unlink, (const char *path), (path), path)
CHANGE(unlinkat, (int a, const char *path, int f), (a, path, f), path)
CHANGE(rmdir, (const char *path), (path), path)
CHANGE(mkdir, (const char *path, mode_t mode), (path, mode), path)
CHANGE(fsync, (int file), (file), "")
CHANGE(syncfs, (int file), (file), "")
