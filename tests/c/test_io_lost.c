#include "io_driver.h"
int main(void)
{
    return test_result();
}
